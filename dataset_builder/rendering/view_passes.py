"""The passes of one view, shared: light-free layers once, source light once, target light and what arrives of it at the
object once per light, S' once per level.

A pass runs when it is first asked for, on the pixels that its layers are wanted on, and is kept for the other examples
of the view.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from time import perf_counter

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan, GoalPlan, RenderPlan
from dataset_builder.layers import LAYERS, PASSES, Pass
from dataset_builder.rendering import passes
from dataset_builder.rendering.light_probe import lighting
from dataset_builder.rendering.passes import FIRST_HIT_CHANNELS, RADIANCE_CHANNELS, RADIANCE_LAYERS, ViewSensor
from dataset_builder.rendering.sampling.adaptive import Goal, Refined, Stop, refine
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.scene.triangle_soup import Soup
from dataset_builder.rendering.scene.window import covered_window
from dataset_builder.rendering.view_scenes import ViewScenes
from dataset_builder.seeding import derive_seed


@dataclass(frozen=True, kw_only=True, eq=False)
class PassResult:
    """What one pass found. pixels: (P,) indices row * width + column, in rising order; seconds: scene building
    included."""

    pixels: np.ndarray
    found: Estimate
    seconds: float
    stopped: Mapping[str, Stop] = field(default_factory=dict)
    """Why sampling of each layer with a goal ended."""


@dataclass(kw_only=True)
class ViewPasses:
    """Passes of the view that `plan` belongs to. spent: seconds of passes run since it was cleared."""

    plan: ExamplePlan
    mesh_root: Path
    spent: dict[str, float] = field(default_factory=dict)
    _results: dict[tuple[str, ...], PassResult] = field(default_factory=dict)

    def run(self, plan: ExamplePlan) -> None:
        """Every pass that a layer of the example needs, in the order that opens the fewest scenes; none stays open."""
        try:
            self.first_hit()
            if any(name == "instance" for name, _ in plan.render.layers):
                self.instances()
            for render_pass in needed_passes(plan):
                self.result(render_pass, plan)
            if needs_lighting(plan):
                self.lighting(plan)
        finally:
            self.scenes.close()

    @cached_property
    def scenes(self) -> ViewScenes:
        """What is traced."""
        return ViewScenes(plan=self.plan, mesh_root=self.mesh_root)

    @property
    def view(self) -> ViewSensor:
        """Camera and resolution, in the frame of the scenes."""
        return self.scenes.view

    # Passes

    def result(self, render_pass: Pass, plan: ExamplePlan) -> PassResult:
        """What a pass found that an example of this view needs."""
        return {"first_hit": lambda _: self.first_hit(), "source": lambda _: self.source(), "target": self.target,
                "rough": self.rough, "first_hit_rough": self.first_hit_rough}[render_pass](plan)

    def first_hit(self) -> PassResult:
        """Light-free layers of the 3DM."""
        def make(pixels: np.ndarray) -> Estimate:
            return passes.first_hit(self.view, self.scenes.dark(), pixels, spp=self._render.spp_first_hit,
                                    seed=self._seed("first_hit"))
        return self._once(("first_hit",),
                          lambda: self._wanted("first_hit", self._window(self.scenes.clean_object)), make)

    def first_hit_rough(self, plan: ExamplePlan) -> PassResult:
        """Light-free layers of the R3DM, once per light: its lamps stand in the scene, and the bits shall be the
        plan's."""
        def make(pixels: np.ndarray) -> Estimate:
            return passes.first_hit(self.view, self._rough(plan), pixels, spp=self._render.spp_first_hit,
                                    seed=self._seed("first_hit_rough", plan.rough.level))

        def window() -> np.ndarray:
            return self._window(self.scenes.rough_object(plan.rough))
        return self._once(("first_hit_rough", str(plan.light), plan.rough.model_dump_json()),
                          lambda: self._wanted("first_hit_rough", window()), make)

    def instances(self) -> PassResult:
        """Instance at every pixel's centre."""
        def make(pixels: np.ndarray) -> Estimate:
            found = passes.instances(self.view, self.scenes.dark(), pixels)
            return Estimate.exact(found[:, None])
        return self._once(("instance",), lambda: np.arange(self._render.width * self._render.height), make)

    def source(self) -> PassResult:
        """The 3DM under the source illumination, with what blocks it out of the way."""
        return self._lit(("source",), self.plan, self.scenes.source, self.covered, self._render.spp_source,
                         self._seed("source"))

    def target(self, plan: ExamplePlan) -> PassResult:
        """The 3DM under one target illumination."""
        return self._lit(("target", str(plan.light)), plan, lambda: self.scenes.target(plan), self.covered,
                         self._render.spp_target, self._seed("target", plan.light))

    def rough(self, plan: ExamplePlan) -> PassResult:
        """The R3DM of one noise level under one target illumination."""
        return self._lit(("rough", str(plan.light), plan.rough.model_dump_json()), plan, lambda: self._rough(plan),
                         lambda: self.covered_by_either(plan), self._render.spp_rough,
                         self._seed("rough", plan.light, plan.rough.level))

    def lighting(self, plan: ExamplePlan) -> PassResult:
        """Spherical harmonics of what arrives at the middle of the 3DM's box under one target illumination, with the
        3DM hidden: one pixel, channels as `light_probe.lighting` has them. The frame's origin is that middle, and its
        axes are the world's."""
        def make(_: np.ndarray) -> Estimate:
            return lighting(self.scenes.surroundings(plan), max_depth=plan.effects.of("target").max_depth,
                            rr_depth=self._render.rr_depth, seed=self._seed("lighting", plan.light))
        return self._once(("lighting", str(plan.light)), lambda: np.zeros(1, dtype=np.int64), make)

    def _rough(self, plan: ExamplePlan) -> OpenScene:
        return self.scenes.rough(plan, lit=_asked(plan, "rough"))

    def _lit(self, key: tuple[str, ...], plan: ExamplePlan, opened: Callable[[], OpenScene],
             covered: Callable[[], np.ndarray], first: int, seed: int) -> PassResult:
        """A pass with light, in as many iterations as its layers' goals ask for."""
        name = key[0]

        def make(pixels: np.ndarray) -> Refined:
            sample = passes.radiance_sampler(self.view, opened(), plan.effects.of(name).max_depth)
            goals = [self._goal(goal, pixels, covered()) for goal in plan.render.goals
                     if LAYERS[goal.layer].render_pass == name]
            return refine(sample, pixels, self._render.width, first=first, batches=self._render.batches, goals=goals,
                          seed=seed)
        return self._once(key, lambda: self._wanted(name, covered()), make)

    def _goal(self, goal: GoalPlan, pixels: np.ndarray, covered: np.ndarray) -> Goal:
        """A layer's goal on the pixels of its own extent."""
        extent = dict(self._render.layers).get(goal.layer, "object")
        inside = np.isin(pixels, covered) if extent == "object" else np.ones(len(pixels), dtype=bool)
        return Goal(layer=goal.layer, channels=RADIANCE_CHANNELS[RADIANCE_LAYERS[goal.layer]], inside=inside,
                    error=goal.error, seconds=goal.seconds, cap=goal.cap)

    # Pixels

    def covered(self) -> np.ndarray:
        """Pixels of which the 3DM covers some."""
        return _with_mask(self.first_hit())

    def covered_by_either(self, plan: ExamplePlan) -> np.ndarray:
        """Pixels of which the 3DM or the R3DM covers some."""
        return np.union1d(self.covered(), _with_mask(self.first_hit_rough(plan)))

    def _window(self, soup: Soup) -> np.ndarray:
        points = soup.corners[soup.instance == self.plan.target.instance].reshape(-1, 3)
        return covered_window(Pinhole.of(self.view.camera, self._render.width, self._render.height), points)

    def _wanted(self, render_pass: str, pixels: np.ndarray) -> np.ndarray:
        """The frame if the pass is planned there, else `pixels`."""
        everywhere = self.plan.effects.of(render_pass).extent == "frame"
        return np.arange(self._render.width * self._render.height) if everywhere else pixels

    # Bookkeeping

    @property
    def _render(self) -> RenderPlan:
        return self.plan.render

    def _seed(self, *path: str | int) -> int:
        return derive_seed(int(self._render.seed), *path)

    def _once(self, key: tuple[str, ...], where: Callable[[], np.ndarray],
              make: Callable[[np.ndarray], Estimate | Refined]) -> PassResult:
        if key not in self._results:
            pixels = where()
            start = perf_counter()
            made = make(pixels) if len(pixels) else Estimate.empty()
            refined = made if isinstance(made, Refined) else Refined(found=made, stopped={}, iterations=1)
            self._results[key] = PassResult(pixels=pixels, found=refined.found, seconds=perf_counter() - start,
                                            stopped=refined.stopped)
            self.spent[key[0]] = self.spent.get(key[0], 0.0) + self._results[key].seconds
        return self._results[key]


def needed_passes(plan: ExamplePlan) -> tuple[Pass, ...]:
    """The passes that the layers of an example need, in order; the first always, for it finds the object's pixels."""
    return tuple(name for name in PASSES if name == "first_hit" or _asked(plan, name)
                 or (name == "first_hit_rough" and _asked(plan, "rough")))


def needs_lighting(plan: ExamplePlan) -> bool:
    """Whether an example has layers under its target illumination."""
    return _asked(plan, "target") or _asked(plan, "rough")


def _asked(plan: ExamplePlan, render_pass: Pass) -> bool:
    return any(LAYERS[name].render_pass == render_pass for name, _ in plan.render.layers)


def _with_mask(result: PassResult) -> np.ndarray:
    return result.pixels[result.found.mean[:, FIRST_HIT_CHANNELS["mask"]][:, 0] > 0]
