"""How a pass is sampled: step by step, each remembered as soon as it is there."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan, GoalPlan, RenderPlan
from dataset_builder.layers import LIT, PASSES, sampled_as
from dataset_builder.rendering.pass_inputs import goals_at, steps_of
from dataset_builder.rendering.pass_memory import PassFound, PassMemory, PassResult
from dataset_builder.rendering.passes import radiance_channels
from dataset_builder.rendering.sampling.adaptive import Goal, Sample, more_samples, refine
from dataset_builder.seeding import derive_seed

Pixels = Callable[[], np.ndarray]


@dataclass(frozen=True, kw_only=True)
class PassSteps:
    """The steps of the pass `name` of an example."""

    name: str
    plan: ExamplePlan
    memory: PassMemory
    seeds: tuple[int, ...]
    """Numbers that its random numbers derive from, besides the name of the pass that it is sampled as."""

    @property
    def _render(self) -> RenderPlan:
        return self.plan.render

    def sampled(self, found: PassFound, done: int, sampler: Callable[[], Sample], covered: Pixels) -> PassFound:
        """What the pass finds, from its step number `done` on. sampler: opens the scene; covered: the object's
        pixels."""
        name, plan, pixels, batches = self.name, self.plan, found.pixels, self._render.batches
        seed = derive_seed(int(self._render.seed), sampled_as(name), *self.seeds)
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
            found = replace(found, sampled=found.sampled.rounded() if name in LIT else found.sampled.without_parts())
            self.memory.keep(plan, name, step + 1, found)
        return found

    def _goal(self, goal: GoalPlan, pixels: np.ndarray, covered: np.ndarray) -> Goal:
        """A layer's goal on the pixels of its own extent."""
        extent = dict(self._render.layers).get(goal.layer, "object")
        inside = np.isin(pixels, covered) if extent == "object" else np.ones(len(pixels), dtype=bool)
        return Goal(layer=goal.layer, channels=radiance_channels(goal.layer), inside=inside,
                    error=goal.error, seconds=goal.seconds, cap=goal.cap)

    def finished(self, found: PassFound) -> PassResult:
        """The result of all steps."""
        sampled, width = found.sampled, self._render.width
        lit = self.name in LIT and len(found.pixels)
        raw = sampled.together
        estimate = sampled.estimate(found.pixels, width) if lit else raw
        return PassResult(pixels=found.pixels, found=estimate, raw=raw, stopped=sampled.stopped, facts=found.facts)
