"""How long trainings will take, by a few real steps of each kind in a folder that goes away again."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, nan, sqrt
from pathlib import Path
from statistics import fmean, stdev
from tempfile import TemporaryDirectory
from time import perf_counter

from dataset_builder.lightnet.training.events import Checked, Started, Stepped
from dataset_builder.lightnet.training.fit import LOG, TrainingJob, fit
from dataset_builder.studies.comma_separated import read_csv
from dataset_builder.studies.trainings import about, changed

STEPS, IMAGES = 4, 2
"""Steps of a trial, of which the first is not counted, and held-out images that it measures."""
WORTH = 10 * STEPS
"""Fewest steps that are left of a training which is tried beforehand."""


@dataclass(frozen=True, kw_only=True)
class TrialTimes:
    """Seconds of the parts of a training."""

    setup: float
    """Until the first step."""
    step: float
    error: float
    """Standard error of `step`."""
    image: float
    """A held-out image at a check, or at the end."""
    held_out: int
    """Examples of the split that is measured on."""

    def of(self, job: TrainingJob, left: int) -> tuple[float, float]:
        """Seconds of a training of which `left` steps are to be done, and their standard error."""
        check = job.spec.check
        images = left / check.every * min(check.examples or self.held_out, self.held_out) + self.held_out
        return self.setup + left * self.step + images * self.image, left * self.error


@dataclass(frozen=True, kw_only=True)
class Forecast:
    """What some trainings will take, in their order; 0 seconds for what is done or learns nothing."""

    seconds: tuple[float, ...]
    error: float
    """Standard error of their sum, from the spread of steps: what else the machine does later is not in it."""
    steps: int
    """Those that are left, of all trainings together."""
    kinds: int
    """Different trainings that were tried."""

    @property
    def total(self) -> float:
        """Seconds of all."""
        return sum(self.seconds)


def forecast(jobs: Sequence[TrainingJob | None]) -> Forecast | None:
    """Try each kind of training and add up; None where too few steps are left to be worth it. A job that is None takes
    no time. Raises UserError as `fit` does."""
    left = [0 if job is None else steps_left(job) for job in jobs]
    if max(left, default=0) < WORTH:
        return None
    kinds = {_kind(job): job for job, steps in zip(jobs, left, strict=True) if job and steps}
    times = {kind: trial(job) for kind, job in kinds.items()}
    # The first trial also does what a process does once
    setup = min(one.setup for one in times.values())
    found = [replace(times[_kind(job)], setup=setup).of(job, steps) if job and steps else (0.0, 0.0)
             for job, steps in zip(jobs, left, strict=True)]
    return Forecast(seconds=tuple(own for own, _ in found), error=hypot(*(error for _, error in found)),
                    steps=sum(left), kinds=len(times))


def _kind(job: TrainingJob) -> str:
    """The same for trainings whose steps take as long."""
    return changed(job.spec, seed=0, steps=1).model_dump_json() + str(job.levels)


def steps_left(job: TrainingJob) -> int:
    """Steps that an earlier run of this very training has not done."""
    try:
        done = int(read_csv(job.out / LOG)[-1]["step"]) if about(job.out, job.identity()) else 0
    except (FileNotFoundError, IndexError, KeyError, ValueError):
        done = 0
    return max(job.spec.steps - done, 0)


def trial(job: TrainingJob) -> TrialTimes:
    """Time a few steps and one check. Raises UserError as `fit` does."""
    steps, setup, check, held_out, then = list[float](), 0.0, nan, 0, perf_counter()
    with TemporaryDirectory() as folder:
        spec = changed(job.spec, steps=STEPS, check={"every": STEPS, "examples": IMAGES, "patience": 0})
        for event in fit(replace(job, out=Path(folder) / "trial", spec=spec)):
            now = perf_counter()
            if isinstance(event, Started):
                setup, held_out = now - then, event.held_out
            if isinstance(event, Stepped):
                steps.append(event.seconds)
            if isinstance(event, Checked):
                check = (now - then) / max(event.examples, 1)
            then = perf_counter()
    return TrialTimes(setup=setup, step=fmean(steps[1:]), error=stdev(steps[1:]) / sqrt(len(steps) - 1),
                      image=check if held_out else 0.0, held_out=held_out)


class TimeLeft:
    """Seconds that are left while trainings run: the forecast, at the pace that they turn out to have."""

    def __init__(self, found: Forecast):
        self._seconds, self._begun = found.seconds, perf_counter()

    def after(self, number: int, share: float) -> float:
        """After `share` of training `number`, counted from 1."""
        done = sum(self._seconds[:number - 1]) + share * self._seconds[number - 1]
        pace = (perf_counter() - self._begun) / done if done else 1.0
        return (sum(self._seconds) - done) * pace
