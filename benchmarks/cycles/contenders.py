"""The two sides of the comparison: the same layers of the same example, rendered by us and by Cycles."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import _common as common
import numpy as np
from cycles.client import Blender, CyclesImage
from cycles.scene_file import scene_of, write
from cycles.units import indirect_bounces

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.rendering.examples import render_view

LAYERS = {"i_s": "source", "i_t": "target", "s_prime": "rough"}
"""Layers with Monte Carlo noise, and the render that each comes from."""

PASSES = {"source": ("diffuse_color", "glossy_color"), "target": (), "rough": ("diffuse_direct", "diffuse_indirect")}
"""What Cycles must write beside the combined image: D and R come with I_s."""

TUPLE = "layers={i_s: frame, d: object, r: object, i_t: frame, s_prime: object, mask: object}"
MOST = 4096
"""Cap of adaptive sampling on both sides, spp."""

WHOLE = 0.999
FIRST_ROUND = {False: 16, True: 4}
"""Our first round of adaptive sampling, spp, without and with denoising."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """adaptive, denoise: switches. knob: spp, or where adaptive: our relative standard error, Cycles' threshold."""

    adaptive: bool
    denoise: bool
    knob: float

    @property
    def mode(self) -> str:
        """Name of the switches."""
        return {(False, False): "uniform", (True, False): "adaptive", (False, True): "denoised",
                (True, True): "adaptive, denoised"}[self.adaptive, self.denoise]


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """One layer: (H, W, 3) image, seconds that it took, seconds of updating the scene if they are not among these, and
    mean spp, not a number where it is not told."""

    image: np.ndarray
    seconds: float
    update: float
    spp: float


class Contender(Protocol):
    """Renders every layer at one setting. Last in the tuple: seconds of what the layers need in common."""

    name: str

    def shots(self, setting: Setting, seed: int) -> tuple[Mapping[str, Shot], float]: ...


class Ours:
    """`render_view` on the example with overrides; seconds are those that it states, building of scenes included."""

    name = "ours"

    def __init__(self, index: int, size: int, specs: Path):
        self._index, self._specs = index, specs
        self._fixed = (f"image.width={size}", f"image.height={size}", TUPLE)

    def plan(self, setting: Setting, seed: int) -> ExamplePlan:
        """The example's plan at a setting, with noise of its own."""
        first = FIRST_ROUND[setting.denoise] if setting.adaptive else int(setting.knob)
        asked = [f"render.spp={{first_hit: 64, source: {first}, target: {first}, rough: {first}}}"]
        if setting.adaptive:
            asked.append("render.accuracy={" + ", ".join(f"{layer}: {{error: {setting.knob}, cap: {MOST}}}"
                                                         for layer in LAYERS) + "}")
        if setting.denoise:
            asked.append(f"render.denoise={{layers: [{', '.join(LAYERS)}]}}")
        plan = common.plan(self._index, *self._fixed, *asked)
        return plan.model_copy(update={"render": plan.render.model_copy(update={"seed": str(seed)})})

    def covered(self) -> np.ndarray:
        """(H, W) truth: pixels that the clean and the rough object cover whole."""
        plan = self.plan(Setting(adaptive=False, denoise=False, knob=4), 0)
        found = next(render_view([plan], self._specs)).evidence
        return np.minimum(found["mask"], found["mask_rough"])[..., 0] > WHOLE

    def shots(self, setting: Setting, seed: int) -> tuple[Mapping[str, Shot], float]:
        """S' pays for finding its pixels and for its direct light, denoising is split evenly, the rest is common."""
        found = next(render_view([self.plan(setting, seed)], self._specs))
        spent = dict(found.seconds)
        denoising = spent.pop("denoise") / len(LAYERS) if setting.denoise else 0.0
        spp = {entry.name: entry.paths / max(entry.pixels, 1) for entry in found.record.passes}
        shots = {}
        for layer, render in LAYERS.items():
            seconds = spent.pop(render)
            if render == "rough":
                seconds += spent.pop("first_hit_rough") + spent.pop("rough_direct", 0.0)
            shots[layer] = Shot(image=found.layers[layer], seconds=seconds + denoising, update=0.0, spp=spp[render])
        return shots, sum(spent.values())


class Cycles:
    """Cycles' renders of the same scene, as helpful to it as can be: one that is kept between renders, S' only within
    the rectangle that the object covers, passes only where they are read, render calls alone counted."""

    name = "Cycles"

    def __init__(self, blender: Blender, plan: ExamplePlan, specs: Path, folder: Path):
        self._blender, self._window = blender, (0, 0, plan.render.width, plan.render.height)
        self._bounces = {name: indirect_bounces(plan.effects.of(name).max_depth) for name in PASSES}
        write(plan, scene_of(plan, specs), folder)
        blender.load(folder)

    def crop(self, inside: np.ndarray) -> None:
        """Let S' be traced only in the rectangle about these (H, W) pixels."""
        rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
        left, top, right, bottom = int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
        self._window = left, top, right, bottom

    def shots(self, setting: Setting, seed: int) -> tuple[Mapping[str, Shot], float]:
        """Each render is shown first and traced once for nothing, which updates the scene."""
        return {layer: self._shot(layer, setting, seed) for layer in LAYERS}, 0.0

    def diffuse_colour(self) -> np.ndarray:
        """(H, W, 3) of the rough mesh: where it is 0, Cycles knows no S'."""
        self._blender.show("rough", self._bounces["rough"])
        return self._blender.render(spp=16, seed=0, passes=("diffuse_color",)).passes["diffuse_color"]

    def _shot(self, layer: str, setting: Setting, seed: int) -> Shot:
        render = LAYERS[layer]
        self._blender.show(render, self._bounces[render])
        cold, warm = (self._trace(layer, setting, seed, spp=1).seconds for _ in range(2))
        found = self._trace(layer, setting, seed, spp=MOST if setting.adaptive else int(setting.knob))
        return Shot(image=_image(layer, setting, found), seconds=found.seconds, update=max(cold - warm, 0.0),
                    spp=float("nan") if setting.adaptive else setting.knob)

    def _trace(self, layer: str, setting: Setting, seed: int, spp: int) -> CyclesImage:
        shading = layer == "s_prime"
        return self._blender.render(spp=spp, seed=seed, threshold=setting.knob if setting.adaptive else 0.0,
                                    denoise=("shading" if shading else "combined") if setting.denoise else "",
                                    window=self._window if shading else None, passes=PASSES[LAYERS[layer]])


def _image(layer: str, setting: Setting, found: CyclesImage) -> np.ndarray:
    if layer != "s_prime":
        return found.passes["combined"]
    if setting.denoise:
        return found.passes["composite"]
    return found.passes["diffuse_direct"] + found.passes["diffuse_indirect"]
