"""The passes of one view, shared: light-free layers once, source light once, target light and what arrives of it at the
object once per light, S' once per level.

A pass runs when it is first needed, on the pixels of its layers, unless it is remembered, and is kept for the other
examples of the view.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from math import ceil
from typing import Any

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import Pass
from dataset_builder.rendering import passes
from dataset_builder.rendering.field_pass import field_sampler, field_window
from dataset_builder.rendering.field_shelf import NO_SHELF, FieldShelf
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
)
from dataset_builder.rendering.pass_memory import PassResult
from dataset_builder.rendering.passes import FIRST_HIT_CHANNELS, WANTED, ViewSensor
from dataset_builder.rendering.sampled_passes import Pixels, SampledPasses
from dataset_builder.rendering.sampling.adaptive import Sample
from dataset_builder.rendering.sampling.estimate import groups_of
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.transport.light_paths import LightVertices
from dataset_builder.rendering.view_scenes import ViewScenes


@dataclass(kw_only=True)
class ViewPasses(SampledPasses):
    """Passes of the view that `plan` belongs to."""

    fields: FieldShelf = NO_SHELF
    """Where fields are found."""

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
        return ViewScenes(plan=self.plan, mesh_root=self.mesh_root, fields=self.fields)

    @property
    def view(self) -> ViewSensor:
        """Camera and resolution, in the frame of the scenes."""
        return self.scenes.view

    # Passes

    def result(self, render_pass: Pass, plan: ExamplePlan) -> PassResult:
        """What a pass found that an example of this view needs."""
        return {"first_hit": lambda _: self.first_hit(), "source": lambda _: self.source(),
                "source_clean": lambda _: self.source_clean(), "target": self.target, "rough": self.rough,
                "first_hit_rough": self.first_hit_rough, "pbr": self.pbr, "empty": self.empty}[render_pass](plan)

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
                          facts=lambda: dict(self.scenes.twin(plan.rough).figures))

    def instances(self) -> PassResult:
        """Instance at every pixel's centre."""
        def sampler() -> Sample:
            return lambda pixels, *_: Estimate.exact(passes.instances(self.view, self.scenes.dark(), pixels)[:, None])

        return self._once((INSTANCE,), self.plan, self._frame, sampler)

    def source(self) -> PassResult:
        """What is seen under the source illumination: the 3DM, or a field of it wherever that may be."""
        if not self.plan.field.there:
            return self._lit(("source",), self.plan, self.scenes.source, self.covered)
        return self._once(("source",), self.plan, lambda: field_window(self.scenes),
                          lambda: field_sampler(self.scenes))

    def source_clean(self) -> PassResult:
        """The 3DM under the source illumination, with what blocks it out of the way."""
        if not self.plan.field.there:
            return self.source()
        return self._lit(("source_clean",), self.plan, self.scenes.source, self.covered)

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



def _with_mask(result: PassResult) -> np.ndarray:
    return result.pixels[result.found.mean[:, FIRST_HIT_CHANNELS["mask"]][:, 0] > 0]
