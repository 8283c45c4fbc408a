"""How much figures vary over the views of sequences: means and standard deviations, not standard errors."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import nan, sqrt
from statistics import fmean, stdev
from typing import Self

from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.lightnet.results.sequences import TRUTH, FlickerRow, ViewSequence

FLICKERS: Mapping[str, str] = {"flicker": "flicker", "error_flicker": "flicker of the error"}
"""Fields of `FlickerRow` and their headings; lower is steadier."""


@dataclass(frozen=True, kw_only=True)
class Spread:
    """A figure over all views of some sequences, or over all neighbours."""

    mean: float
    deviation: float
    """Standard deviation over all of them, that between sequences included; NaN for one."""
    within: float
    """Root of the mean variance within each sequence; NaN where none has two."""
    count: int


@dataclass(frozen=True, kw_only=True)
class Steadiness:
    """One method on one sequence, or on all."""

    method: str
    sequence: str
    """Empty for all."""
    metrics: dict[str, Spread]
    """By the name of a metric; none for the truth."""
    flickers: dict[str, Spread]
    """By the names of `FLICKERS`."""
    overlap: float
    """Mean share of an object that its neighbour sees, too."""


@dataclass(frozen=True, kw_only=True)
class SequenceScores:
    """What was found on the sequences of a split."""

    dataset: str
    split: str
    sequences: Sequence[ViewSequence]
    scores: Sequence[ScoreRow]
    flickers: Sequence[FlickerRow]
    keys: Sequence[str]
    """Of the split, by position."""

    @classmethod
    def of(cls, dataset: LightingDataset, sequences: Sequence[ViewSequence],
           rows: Iterable[ScoreRow | FlickerRow]) -> Self:
        """From the rows of `evaluate_sequences`."""
        kinds: tuple[list[ScoreRow], list[FlickerRow]] = [], []
        for row in rows:
            if isinstance(row, ScoreRow):
                kinds[0].append(row)
            else:
                kinds[1].append(row)
        return cls(dataset=dataset.name, split=dataset.split, sequences=sequences, scores=kinds[0], flickers=kinds[1],
                   keys=dataset.keys)

    @property
    def rows(self) -> list[Steadiness]:
        """Every method on all sequences and on each."""
        return steadiness(self.scores, self.flickers, self.sequences, self.keys)

    @property
    def whole(self) -> list[Steadiness]:
        """Every method on all sequences, the truth last."""
        return [row for row in self.rows if not row.sequence]

    @property
    def extent(self) -> str:
        """How much was looked at, and what is missing."""
        planned, found = (sum(sizes) for sizes in zip(*((one.planned, len(one.frames)) for one in self.sequences),
                                                      strict=True))
        count = len(self.sequences)
        return (f"{found} of {planned} views in {count} sequence{'s' if count > 1 else ''}, "
                f"{sum(row.method == TRUTH for row in self.flickers)} neighbours")


def spread(groups: Sequence[Sequence[float]]) -> Spread:
    """Mean and deviations of values by sequence; NaN where there is none."""
    values = [value for group in groups for value in group]
    variances = [stdev(group) ** 2 for group in groups if len(group) > 1]
    return Spread(mean=fmean(values) if values else nan, deviation=stdev(values) if len(values) > 1 else nan,
                  within=sqrt(fmean(variances)) if variances else nan, count=len(values))


def steadiness(scores: Sequence[ScoreRow], flickers: Sequence[FlickerRow],
               sequences: Sequence[ViewSequence], keys: Sequence[str]) -> list[Steadiness]:
    """Every method, the truth last, on all sequences together and then on each. keys: of the dataset, by position."""
    sets = {sequence.name: {keys[index] for index in sequence.indices} for sequence in sequences}
    names = [*dict.fromkeys(row.method for row in scores), *dict.fromkeys(row.method for row in flickers)]
    parts = [("", list(sets.values())), *((name, [own]) for name, own in sets.items() if len(sets) > 1)]
    return [_steadiness(method, part, own, scores, flickers) for method in dict.fromkeys(names) for part, own in parts]


def _steadiness(method: str, sequence: str, sets: Sequence[set[str]], scores: Sequence[ScoreRow],
                flickers: Sequence[FlickerRow]) -> Steadiness:
    own = [[row for row in scores if row.method == method and row.key in keys] for keys in sets]
    pairs = [[row for row in flickers if row.method == method and row.key in keys] for keys in sets]
    metrics = {metric.name: spread([[getattr(row.metrics, metric.name) for row in rows] for rows in own])
               for metric in METRICS}
    return Steadiness(
        method=method, sequence=sequence, metrics=metrics if any(own) else {},
        flickers={name: spread([[getattr(row, name) for row in rows] for rows in pairs]) for name in FLICKERS},
        overlap=fmean([row.overlap for rows in pairs for row in rows] or [nan]))
