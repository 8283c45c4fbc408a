"""Many independent runs of one pass by the same paths: what their mean is, and how well it is known.

Runs of camera paths are the truth that all else is held against. They are kept in a file and grow there: run k has the
same random numbers whenever it is made.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from benchmarks._equal_error import Reference
from benchmarks.transports.lit_pass import LitPass, OpenPass
from dataset_builder.label.example_plan import Transport
from dataset_builder.seeding import derive_seed

TRUTH_SPP = 256
"""Of one run of camera paths for the truth."""
GROUPS = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Regions:
    """Groups of a pass's pixels whose means are compared: all, those of the object, and sixths by brightness."""

    inside: np.ndarray
    """(P, 2 + GROUPS) of truth."""

    @classmethod
    def of(cls, opened: OpenPass) -> "Regions":
        """Brightness as a run of its own finds it, which is not judged."""
        bright = opened.sample("camera", 64, derive_seed(0, "regions")).mean.mean(axis=1)
        sixths = np.argsort(np.argsort(bright, kind="stable")) * GROUPS // len(bright)
        return cls(inside=np.stack([np.ones(len(bright), dtype=bool), opened.object,
                                    *(sixths == group for group in range(GROUPS))], axis=1))

    def means(self, image: np.ndarray) -> np.ndarray:
        """(2 + GROUPS,) means of a (P, 3) image over pixels and channels."""
        return self.inside.T @ image.mean(axis=1) / np.maximum(self.inside.sum(axis=0), 1)


@dataclass(kw_only=True, eq=False)
class Runs:
    """Sums over the runs so far."""

    pixels: np.ndarray
    """(P,) of the pass."""
    inside: np.ndarray
    """As of `Regions`."""
    means: np.ndarray = field(default_factory=lambda: np.zeros((0, 2 + GROUPS)))
    """(N, 2 + GROUPS) of every run."""
    halves: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(2, P, 3) sums over even and over odd runs."""
    squares: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(P,) sums of squared means over channels."""

    @property
    def number(self) -> int:
        """Of runs."""
        return len(self.means)

    def add(self, image: np.ndarray) -> None:
        """One more (P, 3)."""
        if not self.number:
            self.halves, self.squares = np.zeros((2, *image.shape)), np.zeros(len(image))
        self.halves[self.number % 2] += image
        self.squares += image.mean(axis=1) ** 2
        self.means = np.concatenate([self.means, Regions(inside=self.inside).means(image)[None]])

    def mean(self) -> np.ndarray:
        """(P, 3)."""
        return self.halves.sum(axis=0) / self.number

    def grey(self) -> tuple[np.ndarray, np.ndarray]:
        """(P,) means over runs and channels, and the variances of these means."""
        mean = self.mean().mean(axis=1)
        return mean, np.maximum(self.squares / self.number - mean**2, 0) / (self.number - 1)

    def regions(self) -> tuple[np.ndarray, np.ndarray]:
        """(2 + GROUPS,) means and their standard errors."""
        return self.means.mean(axis=0), self.means.std(axis=0, ddof=1) / np.sqrt(self.number)

    def reference(self, inside: np.ndarray | None = None) -> Reference:
        """Even runs and odd ones as two halves. inside: (P,) pixels that count, all by default."""
        even, odd = (self.halves[k] / ((self.number + 1 - k) // 2) for k in (0, 1))
        return Reference.of(even, odd, np.ones(len(even), dtype=bool) if inside is None else inside)


def extend(runs: Runs, opened: OpenPass, transport: Transport, spp: int, number: int, seed: int) -> Iterator[Runs]:
    """Runs until there are `number`; gives them after each."""
    while runs.number < number:
        runs.add(opened.sample(transport, spp, derive_seed(seed, "runs", transport, spp, runs.number)).mean)
        yield runs


def truth(case: LitPass, number: int, folder: Path, opened: OpenPass) -> Runs:
    """At least `number` runs of camera paths, those that the folder keeps among them, unless they are of other pixels;
    the others are added to it."""
    path = folder / f"{case.name.replace(' ', '-')}-{case.key()}.npz"
    runs = None
    if path.exists():
        with np.load(path) as kept:
            runs = Runs(**{entry.name: kept[entry.name] for entry in fields(Runs)})
    if runs is None or not np.array_equal(runs.pixels, opened.pixels):
        runs = Runs(pixels=opened.pixels, inside=Regions.of(opened).inside)
    for _ in extend(runs, opened, "camera", TRUTH_SPP, number, seed=0):
        _keep(path, runs)
    return runs


def _keep(path: Path, runs: Runs) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial.npz")
    np.savez(partial, **{entry.name: getattr(runs, entry.name) for entry in fields(Runs)})
    partial.replace(path)
