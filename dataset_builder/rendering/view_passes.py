"""The passes of one view, shared: light-free layers once, source light once, target light once per light, S' once per
level.

A pass runs when it is first asked for, on the pixels that its layers are wanted on, and is kept for the other examples
of the view.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from time import perf_counter

import numpy as np

from dataset_builder.layers import LAYERS, Pass
from dataset_builder.planning.example_plan import ExamplePlan, IlluminationPlan, RenderPlan, RoughPlan
from dataset_builder.rendering import passes
from dataset_builder.rendering.estimate import Estimate
from dataset_builder.rendering.passes import FIRST_HIT_CHANNELS, View
from dataset_builder.rendering.rough_mesh import RoughTwin, rough_twin
from dataset_builder.rendering.scene import Body, Stage, body_of, staged
from dataset_builder.rendering.soup import Soup, clean, merge, surroundings
from dataset_builder.rendering.surface import Textures
from dataset_builder.rendering.window import covered_window
from dataset_builder.seeding import derive_seed

ORDER: tuple[Pass, ...] = ("first_hit", "target", "source", "first_hit_rough", "rough")
EVERYWHERE = ("mask", "mask_rough", "instance")
"""Layers whose extent needs no further pixels: 0 where the object is not, or a pass of its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PassResult:
    """What one pass found. pixels: (P,) indices row * width + column, in rising order; seconds: scene building
    included."""

    pixels: np.ndarray
    found: Estimate
    seconds: float


@dataclass(kw_only=True)
class ViewPasses:
    """Geometry, scenes and passes of the view that `plan` belongs to. spent: seconds of passes run since it was
    cleared.

    The light-free passes of the 3DM have a scene without lamps, so that they are the same bits whatever light comes
    first; those of the R3DM share the scene of their light, the last that is open until `close`.
    """

    plan: ExamplePlan
    mesh_root: Path
    spent: dict[str, float] = field(default_factory=dict)
    _results: dict[tuple[str, ...], PassResult] = field(default_factory=dict)
    _twins: dict[RoughPlan, RoughTwin] = field(default_factory=dict)
    _rough_bodies: dict[RoughPlan, Body] = field(default_factory=dict)
    """Of the last noise level only: they are large."""
    _scene: ExitStack = field(default_factory=ExitStack)
    _open: tuple[object, Stage] | None = None

    def run(self, plan: ExamplePlan) -> None:
        """Every pass that a layer of the example needs, in the order that opens the fewest scenes; none stays open."""
        try:
            self.first_hit()
            if any(name == "instance" for name, _ in plan.render.layers):
                self.instances()
            for render_pass in needed_passes(plan):
                self.result(render_pass, plan)
        finally:
            self.close()

    def close(self) -> None:
        """Let the open scene go; results stay."""
        self._open = None
        self._scene.close()

    # Geometry

    @cached_property
    def view(self) -> View:
        """Camera and resolution."""
        return View(camera=self.plan.camera, render=self.plan.render)

    @cached_property
    def _target(self) -> Soup:
        return clean(self.plan.target, self.mesh_root)

    @cached_property
    def _room(self) -> Soup:
        return surroundings(self.plan, self.mesh_root)

    @cached_property
    def _materials(self) -> Textures:
        """Materials of the target and of everything about it: the same for every geometry of the view."""
        return Textures.upload([*self._target.materials, *self._room.materials])

    @cached_property
    def _clean_body(self) -> Body:
        return body_of(merge([self._target, self._room]), self._materials)

    @cached_property
    def _open_body(self) -> Body:
        """The clean scene without the parts that block the source light."""
        if not self.plan.source_light.open:
            return self._clean_body
        opened = self._room.without(self.plan.source_light.open)
        return body_of(merge([self._target, opened]), self._materials)

    def _rough_body(self, rough: RoughPlan) -> Body:
        if rough not in self._rough_bodies:
            self._rough_bodies = {rough: body_of(merge([self.twin(rough).soup, self._room]), self._materials)}
        return self._rough_bodies[rough]

    def twin(self, rough: RoughPlan) -> RoughTwin:
        """The R3DM of one noise level."""
        if rough not in self._twins:
            self._twins[rough] = rough_twin(self.plan.target, rough, self.mesh_root)
        return self._twins[rough]

    # Scenes

    def _dark_scene(self) -> Stage:
        return self._stage("dark", lambda: self._clean_body, None)

    def _rough_scene(self, plan: ExamplePlan) -> Stage:
        key, light = ("rough", plan.rough, plan.light), plan.target_light if _asked(plan, "rough") else None
        return self._stage(key, lambda: self._rough_body(plan.rough), light)

    def _stage(self, key: object, body: Callable[[], Body], light: IlluminationPlan | None) -> Stage:
        if self._open is None or self._open[0] != key:
            self.close()
            self._open = key, self._scene.enter_context(staged(body(), light))
        return self._open[1]

    # Passes

    def result(self, render_pass: Pass, plan: ExamplePlan) -> PassResult:
        """What a pass found that an example of this view needs."""
        return {"first_hit": lambda _: self.first_hit(), "source": lambda _: self.source(), "target": self.target,
                "rough": self.rough, "first_hit_rough": self.first_hit_rough}[render_pass](plan)

    def first_hit(self) -> PassResult:
        """Light-free layers of the 3DM."""
        def make(pixels: np.ndarray) -> Estimate:
            return passes.first_hit(self.view, self._dark_scene(), pixels, spp=self._render.spp_first_hit,
                                    seed=self._seed("first_hit"))
        return self._once(("first_hit",), lambda: self._wanted("first_hit", self._window(self._target)), make)

    def first_hit_rough(self, plan: ExamplePlan) -> PassResult:
        """Light-free layers of the R3DM, once per light: its lamps stand in the scene, and the bits shall be the
        plan's."""
        def make(pixels: np.ndarray) -> Estimate:
            return passes.first_hit(self.view, self._rough_scene(plan), pixels, spp=self._render.spp_first_hit,
                                    seed=self._seed("first_hit_rough", plan.rough.level))
        return self._once(("first_hit_rough", str(plan.light), plan.rough.model_dump_json()),
                          lambda: self._wanted("first_hit_rough", self._window(self.twin(plan.rough).soup)), make)

    def instances(self) -> PassResult:
        """Instance at every pixel's centre."""
        def make(pixels: np.ndarray) -> Estimate:
            found = passes.instances(self.view, self._dark_scene(), pixels)
            return Estimate(mean=found[:, None], error=np.zeros((len(found), 1)), spp=1)
        return self._once(("instance",), lambda: np.arange(self._render.width * self._render.height), make)

    def source(self) -> PassResult:
        """The 3DM under the source illumination, with what blocks it out of the way."""
        def make(pixels: np.ndarray) -> Estimate:
            stage = self._stage("source", lambda: self._open_body, self.plan.source_light)
            return passes.radiance(self.view, stage, pixels, spp=self._render.spp_source, seed=self._seed("source"))
        return self._once(("source",), lambda: self._wanted("source", self.covered()), make)

    def target(self, plan: ExamplePlan) -> PassResult:
        """The 3DM under one target illumination."""
        def make(pixels: np.ndarray) -> Estimate:
            stage = self._stage(("target", plan.light), lambda: self._clean_body, plan.target_light)
            return passes.radiance(self.view, stage, pixels, spp=self._render.spp_target,
                                   seed=self._seed("target", plan.light))
        return self._once(("target", str(plan.light)), lambda: self._wanted("target", self.covered()), make)

    def rough(self, plan: ExamplePlan) -> PassResult:
        """The R3DM of one noise level under one target illumination."""
        def make(pixels: np.ndarray) -> Estimate:
            return passes.radiance(self.view, self._rough_scene(plan), pixels, spp=self._render.spp_rough,
                                   seed=self._seed("rough", plan.light, plan.rough.level))
        return self._once(("rough", str(plan.light), plan.rough.model_dump_json()),
                          lambda: self._wanted("rough", self.covered_by_either(plan)), make)

    # Pixels

    def covered(self) -> np.ndarray:
        """Pixels of which the 3DM covers some."""
        return _with_mask(self.first_hit())

    def covered_by_either(self, plan: ExamplePlan) -> np.ndarray:
        """Pixels of which the 3DM or the R3DM covers some."""
        return np.union1d(self.covered(), _with_mask(self.first_hit_rough(plan)))

    def _window(self, soup: Soup) -> np.ndarray:
        points = soup.corners[soup.instance == self.plan.target.instance].reshape(-1, 3)
        return covered_window(self.plan.camera, points, self._render.width, self._render.height)

    def _wanted(self, render_pass: str, pixels: np.ndarray) -> np.ndarray:
        """The frame if a layer of the pass is wanted there, else `pixels`."""
        wanted = {name: extent for name, extent in self._render.layers if LAYERS[name].render_pass == render_pass}
        on_frame = any(extent == "frame" and name not in EVERYWHERE for name, extent in wanted.items())
        return np.arange(self._render.width * self._render.height) if on_frame else pixels

    # Bookkeeping

    @property
    def _render(self) -> RenderPlan:
        return self.plan.render

    def _seed(self, *path: str | int) -> int:
        return derive_seed(int(self._render.seed), *path)

    def _once(self, key: tuple[str, ...], where: Callable[[], np.ndarray],
              make: Callable[[np.ndarray], Estimate]) -> PassResult:
        if key not in self._results:
            pixels = where()
            start = perf_counter()
            found = make(pixels) if len(pixels) else Estimate.empty()
            self._results[key] = PassResult(pixels=pixels, found=found, seconds=perf_counter() - start)
            self.spent[key[0]] = self.spent.get(key[0], 0.0) + self._results[key].seconds
        return self._results[key]


def needed_passes(plan: ExamplePlan) -> tuple[Pass, ...]:
    """The passes that the layers of an example need, in order; the first always, for it finds the object's pixels."""
    return tuple(name for name in ORDER if name == "first_hit" or _asked(plan, name)
                 or (name == "first_hit_rough" and _asked(plan, "rough")))


def _asked(plan: ExamplePlan, render_pass: Pass) -> bool:
    return any(LAYERS[name].render_pass == render_pass for name, _ in plan.render.layers)


def _with_mask(result: PassResult) -> np.ndarray:
    return result.pixels[result.found.mean[:, FIRST_HIT_CHANNELS["mask"]][:, 0] > 0]
