"""One pass after the other: sampled in steps, each remembered, and kept for the other examples of the view."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan, GoalPlan, RenderPlan
from dataset_builder.layers import PASSES
from dataset_builder.rendering.pass_inputs import RADIANCE, goals_at, steps_of
from dataset_builder.rendering.pass_memory import NO_MEMORY, PassFound, PassMemory, PassResult
from dataset_builder.rendering.passes import radiance_channels
from dataset_builder.rendering.sampling.adaptive import Goal, Sample, Sampled, more_samples, refine
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.seeding import derive_seed

Pixels = Callable[[], np.ndarray]


@dataclass(kw_only=True)
class SampledPasses:
    """Results of the passes of the view that `plan` belongs to."""

    plan: ExamplePlan
    mesh_root: Path
    memory: PassMemory = NO_MEMORY
    """Where results are looked up and kept."""
    spent: dict[str, float] = field(default_factory=dict)
    """Seconds of the passes that ran since it was cleared."""
    recalled: list[str] = field(default_factory=list)
    """Passes that were remembered whole since it was cleared."""
    _results: dict[tuple[str, ...], PassResult] = field(default_factory=dict)

    @property
    def _render(self) -> RenderPlan:
        return self.plan.render

    def _frame(self) -> np.ndarray:
        return np.arange(self._render.width * self._render.height)

    def _once(self, key: tuple[str, ...], plan: ExamplePlan, pixels: Pixels, sampler: Callable[[], Sample],
              *seed: int, facts: Callable[[], Mapping[str, float]] = dict) -> PassResult:
        """The result of the pass `key[0]`: what this view has of it, or what is remembered, or both and new samples.

        pixels: of the object, unless the pass is planned on the frame; sampler: opens the scene; seed: numbers that the
        pass's random numbers derive from, besides its name.
        """
        if key not in self._results:
            name = key[0]
            steps, found = self.memory.recall(plan, name)
            if found and steps == steps_of(plan, name):
                self.recalled.append(name)
            else:
                wide = name in PASSES and self.plan.effects.of(name).extent == "frame"
                traced = found.pixels if found else self._frame() if wide else pixels()
                start = perf_counter()
                before = found or PassFound(pixels=traced, sampled=Sampled(halves=(Estimate.empty(),)), facts=facts())
                found = self._sampled(name, plan, before, steps, sampler, pixels,
                                      derive_seed(int(self._render.seed), name, *seed))
                self.spent[name] = self.spent.get(name, 0.0) + perf_counter() - start
            self._results[key] = self._finished(name, found)
        return self._results[key]

    def _sampled(self, name: str, plan: ExamplePlan, found: PassFound, done: int, sampler: Callable[[], Sample],
                 covered: Pixels, seed: int) -> PassFound:
        """A pass's steps from number `done` on, each remembered as soon as it is there."""
        pixels, batches = found.pixels, self._render.batches
        parts = self._render.parts(name) if name in PASSES else (1,)
        # Before the scene is opened: one at a time
        goals = [[self._goal(goal, pixels, covered()) for goal in goals_at(plan, name, step)]
                 for step in range(steps_of(plan, name))]
        sample = sampler() if len(pixels) else None
        for step in range(done, steps_of(plan, name)):
            known = found.sampled if step else None
            if sample and goals[step]:
                found = replace(found, sampled=refine(sample, pixels, self._render.width, first=sum(parts),
                                                      goals=goals[step], batches=batches, seed=seed, before=known))
            elif sample:
                found = replace(found, sampled=more_samples(sample, pixels, known, spp=parts[step], part=step,
                                                            batches=batches, seed=seed))
            if name in RADIANCE:
                found = replace(found, sampled=found.sampled.rounded())
            self.memory.keep(plan, name, step + 1, found)
        return found

    def _goal(self, goal: GoalPlan, pixels: np.ndarray, covered: np.ndarray) -> Goal:
        """A layer's goal on the pixels of its own extent."""
        extent = dict(self._render.layers).get(goal.layer, "object")
        inside = np.isin(pixels, covered) if extent == "object" else np.ones(len(pixels), dtype=bool)
        return Goal(layer=goal.layer, channels=radiance_channels(goal.layer), inside=inside,
                    error=goal.error, seconds=goal.seconds, cap=goal.cap)

    def _finished(self, name: str, found: PassFound) -> PassResult:
        sampled, width = found.sampled, self._render.width
        lit = name in RADIANCE and len(found.pixels)
        estimate = sampled.estimate(found.pixels, width) if lit else sampled.halves[0]
        return PassResult(pixels=found.pixels, found=estimate, stopped=sampled.stopped, facts=found.facts)
