"""The passes of one view, shared: light-free layers once, source light once, target light and what arrives of it at the
object once per light, S' once per level.

A pass runs when it is first needed, on the pixels of its layers, unless it is remembered, and is kept for the other
examples of the view.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan, RenderPlan
from dataset_builder.layers import PASSES, Pass
from dataset_builder.rendering import passes
from dataset_builder.rendering.joined import InStep, light_paths
from dataset_builder.rendering.light_probe import lighting
from dataset_builder.rendering.pass_inputs import (
    DIRECT,
    DIRECT_DEPTH,
    INSTANCE,
    LIGHTING,
    all_passes,
    compared_with,
    in_step,
    lights_rough,
    needed_passes,
    needs_lighting,
    steps_of,
)
from dataset_builder.rendering.pass_memory import NO_MEMORY, PassFound, PassMemory, PassResult
from dataset_builder.rendering.pass_steps import PassSteps, Pixels
from dataset_builder.rendering.passes import FIRST_HIT_CHANNELS, WANTED, ViewSensor
from dataset_builder.rendering.sampling.adaptive import Sample, Sampled
from dataset_builder.rendering.sampling.estimate import groups_of
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.transport.light_paths import LightVertices
from dataset_builder.rendering.view_scenes import ViewScenes


@dataclass(kw_only=True)
class ViewPasses:
    """Passes of the view that `plan` belongs to."""

    plan: ExamplePlan
    mesh_root: Path
    memory: PassMemory = NO_MEMORY
    """Where results are looked up and kept."""
    spent: dict[str, float] = field(default_factory=dict)
    """Seconds of the passes that ran since it was cleared."""
    recalled: list[str] = field(default_factory=list)
    """Passes that were remembered whole since it was cleared."""
    _results: dict[tuple[str, ...], PassResult] = field(default_factory=dict)

    def run(self, plan: ExamplePlan) -> None:
        """Every pass that a layer of the example needs, in the order that opens the fewest scenes; none stays open."""
        try:
            self.first_hit()
            if INSTANCE in all_passes(plan):
                self.instances()
            for render_pass in needed_passes(plan):
                self.result(render_pass, plan)
                if render_pass == "rough" and DIRECT in all_passes(plan):
                    self.rough_direct(plan)
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
                "rough": self.rough, "first_hit_rough": self.first_hit_rough, "pbr": self.pbr,
                "empty": self.empty}[render_pass](plan)

    def first_hit(self) -> PassResult:
        """Light-free layers of the 3DM."""
        def sampler() -> Sample:
            return partial(passes.first_hit, self.view, self.scenes.dark())

        return self._once(("first_hit",), self.plan, lambda: self.scenes.window(self.scenes.clean_object), sampler,
                          facts=lambda: {"unit": self.scenes.local_frame.unit})

    def first_hit_rough(self, plan: ExamplePlan) -> PassResult:
        """Light-free layers of the R3DM, once per light: its lamps stand in the scene, and the bits shall be the
        plan's."""
        def sampler() -> Sample:
            return partial(passes.first_hit, self.view, self._rough(plan))

        return self._once(("first_hit_rough", str(plan.light), plan.rough.model_dump_json()), plan,
                          lambda: self.scenes.window(self.scenes.rough_object(plan.rough)), sampler, plan.rough.level,
                          facts=lambda: self.scenes.twin(plan.rough).roughness.model_dump())

    def instances(self) -> PassResult:
        """Instance at every pixel's centre."""
        def sampler() -> Sample:
            return lambda pixels, *_: Estimate.exact(passes.instances(self.view, self.scenes.dark(), pixels)[:, None])

        return self._once((INSTANCE,), self.plan, self._frame, sampler)

    def source(self) -> PassResult:
        """The 3DM under the source illumination, with what blocks it out of the way."""
        return self._lit(("source",), self.plan, self.scenes.source, self.covered)

    def target(self, plan: ExamplePlan) -> PassResult:
        """The 3DM under one target illumination."""
        return self._lit(("target", str(plan.light)), plan, lambda: self.scenes.target(plan), self.covered, plan.light)

    def rough(self, plan: ExamplePlan) -> PassResult:
        """The R3DM of one noise level under one target illumination."""
        return self._lit(("rough", str(plan.light), plan.rough.model_dump_json()), plan, lambda: self._rough(plan),
                         lambda: self.covered_by_either(plan), plan.light, plan.rough.level)

    def pbr(self, plan: ExamplePlan) -> PassResult:
        """The whole scene with the R3DM in it under one target illumination, by the target pass's random numbers."""
        return self._lit(("pbr", str(plan.light), plan.rough.model_dump_json()), plan, lambda: self._rough(plan),
                         lambda: self.covered_by_either(plan), plan.light)

    def empty(self, plan: ExamplePlan) -> PassResult:
        """The scene without the target object under one target illumination, by the target pass's random numbers: what
        the object changes nothing of has the same bits, but for light that is found by paths from the lamps."""
        return self._lit(("empty", str(plan.light)), plan, lambda: self.scenes.surroundings(plan), self.covered,
                         plan.light)

    def rough_direct(self, plan: ExamplePlan) -> PassResult:
        """As `rough`, without light that has bounced: the same pixels, as many samples as that took on average, all of
        them its own."""
        rough, depth = self.rough(plan), min(DIRECT_DEPTH, plan.effects.of("rough").max_depth)

        def sampler() -> Sample:
            direct = passes.radiance_sampler(self.view, self._rough(plan), depth, wanted=WANTED["rough"])
            spp = ceil(rough.found.spp.mean())
            return lambda pixels, _, batches, seed: direct(pixels, spp, batches, seed)

        return self._once((DIRECT, str(plan.light), plan.rough.model_dump_json()), plan,
                          lambda: rough.pixels, sampler, plan.light, plan.rough.level)

    def lighting(self, plan: ExamplePlan) -> PassResult:
        """Spherical harmonics of what arrives at the middle of the 3DM's box under one target illumination, with the
        3DM hidden: one pixel, channels as `rendering.light_probe` has them. The frame's origin is that middle, and its
        axes are the world's."""
        def sampler() -> Sample:
            return lambda pixels, spp, batches, seed: lighting(
                self.scenes.surroundings(plan), max_depth=plan.effects.of("target").max_depth,
                rr_depth=self._render.rr_depth, seed=seed)

        return self._once((LIGHTING, str(plan.light)), plan, lambda: np.zeros(1, dtype=np.int64), sampler, plan.light)

    def _rough(self, plan: ExamplePlan) -> OpenScene:
        return self.scenes.rough(plan, lit=lights_rough(plan))

    def _lit(self, key: tuple[str, ...], plan: ExamplePlan, opened: Callable[[], OpenScene], covered: Pixels,
             *seed: int) -> PassResult:
        """A pass with light."""
        effects = plan.effects.of(key[0])
        setting = effects.max_depth, effects.transport, effects.caustics, WANTED[key[0]]

        def sampler() -> Sample:
            if not in_step(plan, key[0]):
                return passes.radiance_sampler(self.view, opened(), *setting)
            return in_steps

        def in_steps(*what: Any) -> Estimate:
            theirs = self._light_paths(compared_with(plan, key[0]), plan, *what)
            return passes.radiance_sampler(self.view, opened(), *setting, in_step=InStep(other=theirs))(*what)

        return self._once(key, plan, covered, sampler, *seed)

    def _light_paths(self, name: Pass | None, plan: ExamplePlan, pixels: np.ndarray, spp: int, batches: int,
                     seed: int) -> dict[int, LightVertices]:
        """Those of another pass, whose scene is closed again before this one's is opened; none of no pass."""
        if name is None:
            return {}
        effects = plan.effects.of(name)
        return light_paths(self.view, {"target": self.scenes.target, "empty": self.scenes.surroundings}[name](plan),
                           effects.max_depth, effects.caustics, sorted(WANTED[name]),
                           groups_of(pixels, spp, batches, seed))

    # Pixels

    def covered(self) -> np.ndarray:
        """Pixels of which the 3DM covers some."""
        return _with_mask(self.first_hit())

    def covered_by_either(self, plan: ExamplePlan) -> np.ndarray:
        """Pixels of which the 3DM or the R3DM covers some."""
        return np.union1d(self.covered(), _with_mask(self.first_hit_rough(plan)))

    def _frame(self) -> np.ndarray:
        return np.arange(self._render.width * self._render.height)

    # Sampling

    @property
    def _render(self) -> RenderPlan:
        return self.plan.render

    def _once(self, key: tuple[str, ...], plan: ExamplePlan, pixels: Pixels, sampler: Callable[[], Sample],
              *seed: int, facts: Callable[[], Mapping[str, float]] = dict) -> PassResult:
        """The result of the pass `key[0]`: what this view has of it, or what is remembered, or both and new samples.

        pixels: of the object, unless the pass is planned on the frame; sampler: opens the scene; seed: numbers that the
        pass's random numbers derive from, besides the name of what it is sampled as.
        """
        if key not in self._results:
            name = key[0]
            run = PassSteps(name=name, plan=plan, memory=self.memory, seeds=seed)
            steps, found = self.memory.recall(plan, name)
            if found and steps == steps_of(plan, name):
                self.recalled.append(name)
            else:
                wide = name in PASSES and self.plan.effects.of(name).extent == "frame"
                traced = found.pixels if found else self._frame() if wide else pixels()
                start = perf_counter()
                before = found or PassFound(pixels=traced, sampled=Sampled(halves=(Estimate.empty(),)), facts=facts())
                found = run.sampled(before, steps, sampler, pixels)
                self.spent[name] = self.spent.get(name, 0.0) + perf_counter() - start
            self._results[key] = run.finished(found)
        return self._results[key]


def _with_mask(result: PassResult) -> np.ndarray:
    return result.pixels[result.found.mean[:, FIRST_HIT_CHANNELS["mask"]][:, 0] > 0]
