"""One pass of one example, open for sampling by whichever paths, on the pixels and channels that the product takes."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dataset_builder.digest import digest
from dataset_builder.label.example_plan import ExamplePlan, Transport
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.pass_inputs import inputs_of
from dataset_builder.rendering.passes import RADIANCE_CHANNELS, ViewSensor, radiance_sampler
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.view_passes import ViewPasses
from dataset_builder.spec.load import load_dataset

LETTERS = {"s": ("source", "image"), "t": ("target", "image"), "r": ("rough", "shading")}
"""Last letter of a case -> its pass, and the channels that are judged."""

HOW = ("transport", "openings", "samples")
"""Inputs of a pass that say how its means are found, not what they are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LitPass:
    """A pass with light of one example."""

    name: str
    """Specification, index of the example, letter: `3df-lighting-mini 22t`."""
    letter: str
    plan: ExamplePlan
    root: Path

    @property
    def kind(self) -> str:
        """`source`, `target` or `rough`."""
        return LETTERS[self.letter][0]

    @property
    def planned(self) -> Transport:
        """Paths that the plan takes."""
        return self.plan.effects.of(self.kind).transport

    @property
    def lamps(self) -> str:
        """Kinds of its lights."""
        light = self.plan.source_light if self.kind == "source" else self.plan.target_light
        return ",".join(lamp.kind for lamp in light.lights)

    def key(self) -> str:
        """Digest of what its means depend on, whichever paths find them and however many."""
        said = inputs_of(self.plan, self.kind)
        return digest({name: value for name, value in said.items() if name not in HOW})[:16]

    @contextmanager
    def opened(self) -> Iterator["OpenPass"]:
        """The scene, while it is open."""
        passes = ViewPasses(plan=self.plan, mesh_root=self.root)
        effects, render = self.plan.effects.of(self.kind), self.plan.render
        covered = passes.covered_by_either(self.plan) if self.kind == "rough" else passes.covered()
        pixels = np.arange(render.width * render.height) if effects.extent == "frame" else covered
        scenes = passes.scenes
        scene = {"source": scenes.source, "target": lambda: scenes.target(self.plan),
                 "rough": lambda: scenes.rough(self.plan)}[self.kind]()
        try:
            yield OpenPass(view=passes.view, scene=scene, pixels=pixels, object=np.isin(pixels, covered),
                           channels=RADIANCE_CHANNELS[LETTERS[self.letter][1]], max_depth=effects.max_depth,
                           caustics=effects.caustics)
        finally:
            scenes.close()


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenPass:
    """A pass whose scene is open."""

    view: ViewSensor
    scene: OpenScene
    pixels: np.ndarray
    """(P,) those that the plan traces."""
    object: np.ndarray
    """(P,) of truth: those that the target object covers in part."""
    channels: slice
    max_depth: int
    caustics: bool

    @property
    def width(self) -> int:
        """Of the frame, pixels."""
        return self.view.render.width

    def sample(self, transport: Transport, spp: int, seed: int) -> Estimate:
        """(P, 3) means and errors of the judged channels. The sampler is made anew: its tables are part of the cost."""
        sampler = radiance_sampler(self.view, self.scene, self.max_depth, transport, self.caustics)
        found = sampler(self.pixels, spp, self.view.render.batches, seed)
        return replace(found, mean=found.mean[:, self.channels], error=found.error[:, self.channels],
                       freedom=found.freedom[:, self.channels])


def passes_of(spec: Path, names: Sequence[str], overrides: Sequence[str] = ()) -> Iterator[LitPass]:
    """Passes of a spec by names such as `22t`: the index of an example and a letter of `LETTERS`. Overrides as `--set`
    takes them. Raises SpecError and PlanError; ValueError for a name of another form."""
    planner = Planner(load_dataset(spec, tuple(overrides)))
    for name in names:
        index, letter = name[:-1], name[-1:]
        if not index.isdecimal() or letter not in LETTERS or int(index) >= len(planner.examples):
            raise ValueError(f"expected the index of one of {len(planner.examples)} examples and one of the letters "
                             f"{', '.join(LETTERS)}, got {name!r}")
        yield LitPass(name=f"{spec.stem} {name}", letter=letter, plan=planner.example(planner.examples[int(index)]),
                      root=spec.parent)
