"""Curves through the rows: means over examples; and the study's conclusions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dataset_builder.studies.accuracy.rows import AccuracyRow, of
from dataset_builder.studies.image_errors import geometric_mean


@dataclass(frozen=True, kw_only=True)
class Point:
    """One setting on a curve: geometric means over examples and runs, unless a field says otherwise."""

    setting: str
    value: float
    """Median."""
    seconds: float
    error: float
    psnr: float
    """Mean, in dB."""
    flip: float
    spp: float
    at_floor: bool
    """In some example noise hides the error, which is an upper bound there."""


def curve(rows: Sequence[AccuracyRow], question: str, layer: str) -> list[Point]:
    """Points of a layer in one question, in the order of the rows: settings that are meant to be cheaper come first."""
    own = of(rows, question, layer)
    settings = dict.fromkeys(row.setting for row in own if math.isfinite(row.relmse))
    return [_point([row for row in own if row.setting == setting]) for setting in settings]


def _point(rows: Sequence[AccuracyRow]) -> Point:
    at_floor = any(row.at_floor for row in rows)
    squares = [row.relmse + (row.floor if row.at_floor else 0.0) for row in rows]
    mean = geometric_mean(squares)
    return Point(setting=rows[0].setting, value=float(np.median([row.value for row in rows])),
                 seconds=geometric_mean(row.seconds for row in rows), error=math.sqrt(mean) if mean > 0 else 0.0,
                 psnr=float(np.mean([row.psnr for row in rows])), flip=geometric_mean(row.flip for row in rows),
                 spp=geometric_mean(row.spp for row in rows), at_floor=at_floor)


@dataclass(kw_only=True)
class Advice:
    """The study's conclusions: one sentence for each question with its numbers, and recommended settings."""

    sentences: dict[str, str] = field(default_factory=dict)
    """By question."""
    overrides: list[str] = field(default_factory=list)
    """As `--set` takes them."""
    marked: dict[tuple[str, str], Point] = field(default_factory=dict)
    """Recommended point by question and layer, where points are what is chosen from."""
    noise: dict[str, float] = field(default_factory=dict)
    """Relative error asked of each layer."""

    def lines(self) -> str:
        """One option of the command line for every override."""
        return "".join(f"--set '{override}'\n" for override in self.overrides)
