"""One pass after the other: sampled in steps, each remembered, and kept for the other examples of the view."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan, RenderPlan
from dataset_builder.layers import PASSES
from dataset_builder.rendering.pass_inputs import steps_of
from dataset_builder.rendering.pass_memory import NO_MEMORY, PassFound, PassMemory, PassResult
from dataset_builder.rendering.pass_steps import PassSteps, Pixels
from dataset_builder.rendering.sampling.adaptive import Sample, Sampled
from dataset_builder.rendering.sampling.moments import Estimate


@dataclass(kw_only=True)
class SampledPasses:
    """Results of the passes of the view that `plan` belongs to."""

    plan: ExamplePlan
    mesh_root: Path
    memory: PassMemory = NO_MEMORY
    """Where results are looked up and kept."""
    spent: dict[str, float] = field(default_factory=dict)
    """Seconds of the passes that ran since it was cleared."""
    worked: dict[str, float] = field(default_factory=dict)
    """The same in seconds of this process on all its cores."""
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
                start, worked = perf_counter(), process_time()
                before = found or PassFound(pixels=traced, sampled=Sampled(halves=(Estimate.empty(),)), facts=facts())
                found = run.sampled(before, steps, sampler, pixels)
                self.spent[name] = self.spent.get(name, 0.0) + perf_counter() - start
                self.worked[name] = self.worked.get(name, 0.0) + process_time() - worked
            self._results[key] = run.finished(found)
        return self._results[key]
