"""Error x time of one pass by two kinds of paths, taken in turn so that a drifting machine drifts for both."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from benchmarks._equal_error import Reference
from benchmarks.transports.lit_pass import LitPass, OpenPass
from dataset_builder.label.example_plan import Transport
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.seeding import derive_seed


@dataclass(frozen=True, kw_only=True)
class Side:
    """What one kind of paths took and found. Variances and errors are relative, as of `Reference.error`."""

    variances: Sequence[float]
    """Of every run, by its own batches."""
    seconds: float
    """CPU seconds of a run, median: light paths, tables and all."""
    errors: Sequence[float] = ()
    """relMSE of every run against the truth; none where that is not known."""


@dataclass(frozen=True, kw_only=True)
class Race:
    """One pass at one spp."""

    case: LitPass
    spp: int
    old: Side
    new: Side

    @property
    def v(self) -> float:
        """Variance, new over old."""
        return float(np.mean(self.new.variances) / np.mean(self.old.variances))

    @property
    def t(self) -> float:
        """CPU time, new over old."""
        return self.new.seconds / self.old.seconds

    @property
    def p(self) -> float:
        """Time to equal error by the errors that each claims."""
        return self.v * self.t

    @property
    def e(self) -> tuple[float, float] | None:
        """Time to equal error by the errors that each has, which is relMSE at equal time: by the means and by the
        medians of all runs. A rare bright path makes a mean what it is."""
        if not self.new.errors:
            return None
        return (float(np.mean(self.new.errors) / np.mean(self.old.errors)) * self.t,
                float(np.median(self.new.errors) / np.median(self.old.errors)) * self.t)

    @property
    def doubt(self) -> float:
        """Standard error of p over p, from how far the variances of runs differ."""
        parts = [(np.std(side.variances, ddof=1) / np.mean(side.variances)) ** 2 / len(side.variances)
                 for side in (self.old, self.new)]
        return float(np.sqrt(sum(parts)))

    @property
    def planned(self) -> float:
        """p of the paths that the plan takes: 1 where these are the old ones."""
        return 1.0 if self.case.planned == "camera" else self.p


def race(case: LitPass, opened: OpenPass, new: Transport, spp: int, repeats: int, known: Reference | None) -> Race:
    """Runs of both in turn, after one of each for the kernels."""
    sides: tuple[Transport, Transport] = ("camera", new)
    found: tuple[list[Estimate], list[Estimate]] = ([], [])
    seconds: tuple[list[float], list[float]] = ([], [])
    for repeat in range(-1, repeats):
        for k, transport in enumerate(sides):
            begin = process_time()
            run = opened.sample(transport, spp, derive_seed(1, "race", k, repeat + 1))
            if repeat >= 0:
                seconds[k].append(process_time() - begin)
                found[k].append(run)
    mean = np.mean([run.mean for runs in found for run in runs], axis=0)
    old, fresh = (Side(variances=[relative_variance(run, mean) for run in runs], seconds=float(np.median(times)),
                       errors=[known.error(run.mean) for run in runs] if known else ())
                  for runs, times in zip(found, seconds, strict=True))
    return Race(case=case, spp=spp, old=old, new=fresh)


def relative_variance(found: Estimate, mean: np.ndarray) -> float:
    """Mean over pixels and channels of se^2 / (x^2 + (0.1 m)^2), x the (P, 3) `mean` and m its mean."""
    return float(np.mean(found.error**2 / (mean**2 + 0.01 * mean.mean() ** 2)))


def geometric_mean(values: Sequence[float]) -> float:
    """Of ratios."""
    return float(np.exp(np.mean(np.log(values))))


HEAD = (f"{'case':26} {'lights':20} {'plan':6} {'spp':>4} {'variance':>9} {'CPU s':>7} {'v':>6} {'t':>6} {'p':>6} "
        f"{'+-':>5} {'relMSE':>9} {'e':>6} {'median':>9} {'e':>6}")


def line(found: Race) -> str:
    """Old figures, and new ones over them."""
    true = ""
    if found.e:
        true = (f"{np.mean(found.old.errors):9.2e} {found.e[0]:6.3f} {np.median(found.old.errors):9.2e} "
                f"{found.e[1]:6.3f}")
    return (f"{found.case.name:26} {found.case.lamps:20} {found.case.planned:6} {found.spp:4} "
            f"{np.mean(found.old.variances):9.2e} {found.old.seconds:7.2f} {found.v:6.3f} {found.t:6.3f} "
            f"{found.p:6.3f} {found.doubt * found.p:5.3f} {true}")


def summary(found: Sequence[Race]) -> tuple[float, float]:
    """Prints geometric means by spp and over all; (geometric mean, worst) of p as the plan chooses."""
    for spp in (*dict.fromkeys(entry.spp for entry in found), None):
        here = [entry for entry in found if spp in (entry.spp, None)]
        true = [entry.e[1] for entry in here if entry.e is not None]
        told = f", e by medians {geometric_mean(true):.3f}" if true else ""
        print(f"{spp or 'all':>4} spp, {len(here)} passes: p {geometric_mean([r.p for r in here]):.3f} "
              f"(worst {max(r.p for r in here):.3f}), as planned {geometric_mean([r.planned for r in here]):.3f} "
              f"(worst {max(r.planned for r in here):.3f}){told}")
    planned = [entry.planned for entry in found]
    return geometric_mean(planned), max(planned)
