"""What every reader of splats holds the numbers of a file to, before they are a cloud."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import counted, refuse
from dataset_builder.files import size_text
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_harmonics import COUNTS

MOST_SPLATS = 4_000_000
"""Of a file."""
SPLAT_BYTES = 1200
"""Memory that reading a splat with harmonics of degree 3 takes at its peak, bytes, rounded up."""
FAINTEST = 1 / 255
"""Opacity below which a splat is drawn by no rasterizer of Kerbl and others (2023)."""
FLATTEST = 1e-3
"""Least scale of a splat in units of its largest: thinner ones are met by rays in too few digits."""
FARTHEST = 1e6
"""Of centres and scales, file units."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SplatFile:
    """A cloud and what is to be said of the file that it comes from."""

    cloud: SplatCloud
    notes: tuple[str, ...]
    """What was dropped or changed, with counts, and what was taken for granted."""


def check_count(path: Path, count: int) -> None:
    """Raise UserError where a file states no splats, or more than are read."""
    if not count:
        refuse(path, "expected splats, got none")
    if count > MOST_SPLATS:
        refuse(path, f"expected at most {MOST_SPLATS:,} splats, got {count:,}, which would take about "
                     f"{size_text(count * SPLAT_BYTES)} of memory", "crop or prune it in the program that made it")


def checked_cloud(path: Path, *, centres: np.ndarray, scales: np.ndarray, turns: np.ndarray, opacities: np.ndarray,
                  harmonics: np.ndarray, srgb: bool, notes: tuple[str, ...] = ()) -> SplatFile:
    """The splats of a file that can be drawn, in plain numbers; shapes as in `SplatCloud`, quaternions of any length.

    Dropped, and counted: what is not finite or too far away, quaternions of zero, scales of zero or less, what is too
    faint to be seen. Raises UserError where nothing is left.
    """
    told = list(notes)
    keep = np.ones(len(centres), bool)

    def drop(bad: np.ndarray, why: str) -> None:
        if number := int((bad & keep).sum()):
            told.append(f"{counted(number, 'splat')} {why}, dropped")
        keep[bad] = False

    with np.errstate(all="ignore"):
        finite = np.isfinite(centres).all(1) & np.isfinite(turns).all(1) & np.isfinite(opacities)
        drop(~(finite & np.isfinite(scales).all(1) & np.isfinite(harmonics).all((1, 2))), "with NaN or Inf")
        drop(np.maximum(np.abs(centres), scales).max(axis=1) > FARTHEST, f"beyond {FARTHEST:g} units")
        length = np.linalg.norm(turns.astype(np.float64), axis=1)
        drop(~(length > 0), "with a quaternion of zero")
        drop((scales.max(axis=1) <= 0) | (scales.min(axis=1) < 0), "with scales of zero or less")
        drop(~(opacities >= FAINTEST), "with an opacity below 1/255")
    if not keep.any():
        refuse(path, f"expected splats that can be seen, got none: {'; '.join(told[len(notes):])}")
    widest = scales[keep].max(axis=1, keepdims=True)
    if thin := int((scales[keep].min(axis=1, keepdims=True) < FLATTEST * widest).sum()):
        told.append(f"{counted(thin, 'splat')} thinner than {FLATTEST:g} of the length, made that thick")
    if over := int((opacities[keep] > 1).sum()):
        told.append(f"{counted(over, 'opacity', 'opacities')} above 1, taken as 1")
    single = {"centres": centres[keep], "scales": np.maximum(scales[keep], FLATTEST * widest),
              "turns": turns[keep] / length[keep, None], "opacities": np.minimum(opacities[keep], 1),
              "harmonics": harmonics[keep]}
    return SplatFile(notes=tuple(told), cloud=SplatCloud(srgb=srgb, **{
        name: np.ascontiguousarray(value, dtype=np.float32) for name, value in single.items()}))


def check_harmonics(path: Path, count: int, at: str) -> None:
    """Raise UserError where a splat has a number of colour coefficients that no degree has."""
    if count not in COUNTS:
        refuse(path, f"expected harmonics of degree 0 to 3, which are {', '.join(map(str, COUNTS))} for each channel, "
                     f"got {count}", at=at)
