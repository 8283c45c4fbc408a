"""Two pictures of one model -> figures of how alike they are, and whether that is alike enough."""

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

WHOLE = 0.99
"""Coverage from which a pixel counts for albedo."""
FLAT = 5e-3
"""Standard deviation of albedo below which a picture has nothing to correlate."""
LEAST_OVERLAP, LEAST_CORRELATION = 0.97, 0.95
ROUNDING = 1e-6
"""Share of the longest side below which a side is none."""
MOST_OFF = 0.03
"""Relative, for the ratio of albedo; absolute, for its mean difference; relative, for extents."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """What one side shows of a model."""

    albedo: np.ndarray
    """(H, W, 3) of what is there, linear Rec.709."""
    mask: np.ndarray
    """(H, W) coverage in [0, 1]."""
    extents: np.ndarray
    """(3,) in units of the file, z up."""


@dataclass(frozen=True, kw_only=True)
class Likeness:
    """Ours against another importer's, for one model. Not a number where nothing can be said."""

    model: str
    correlation: float = float("nan")
    """Pearson's, of the albedo of all channels and pixels that both cover whole."""
    ratio: float = float("nan")
    """Mean albedo of ours over theirs, there."""
    difference: float = float("nan")
    """Mean absolute difference of albedo, there."""
    overlap: float = float("nan")
    """Of the masks: the sum of their minima over that of their maxima."""
    extent: float = float("nan")
    """The ratio of sides, ours over theirs, that is farthest from 1."""
    ours: str = ""
    """What we say besides: why the file is refused."""
    theirs: str = ""
    """What the importer says."""

    @property
    def differs(self) -> str:
        """What is not alike, in words; empty where all is."""
        if np.isnan(self.overlap):
            return "no picture of ours" if self.ours else "no picture of theirs"
        wrong = {"mask": self.overlap < LEAST_OVERLAP, "size": abs(self.extent - 1) > MOST_OFF,
                 "brightness": abs(self.ratio - 1) > MOST_OFF, "colours": self.difference > MOST_OFF,
                 "pattern": self.correlation < LEAST_CORRELATION}
        return ", ".join(name for name, is_wrong in wrong.items() if is_wrong)


def compare(model: str, ours: Picture, theirs: Picture, notes: str = "") -> Likeness:
    """Figures of two pictures of one size."""
    inside = (ours.mask >= WHOLE) & (theirs.mask >= WHOLE)
    union = float(np.maximum(ours.mask, theirs.mask).sum())
    thick = [side.extents > ROUNDING * side.extents.max() for side in (ours, theirs)]
    sides = np.where(thick[0] & thick[1], ours.extents / np.where(thick[1], theirs.extents, 1), 1)
    overlap = float(np.minimum(ours.mask, theirs.mask).sum()) / union if union else 0.0
    extent = float(sides[np.argmax(np.abs(np.log(sides)))])
    if not inside.any():
        return Likeness(model=model, overlap=overlap, extent=extent, theirs=notes)
    a, b = (picture.albedo[inside].astype(np.float64) for picture in (ours, theirs))
    flat = min(a.std(), b.std()) < FLAT
    return Likeness(model=model, overlap=overlap, extent=extent, theirs=notes,
                    correlation=float("nan") if flat else float(np.corrcoef(a.ravel(), b.ravel())[0, 1]),
                    ratio=float(a.mean() / b.mean()) if b.mean() > 0 else float("nan"),
                    difference=float(np.abs(a - b).mean()))


def print_table(rows: Sequence[Likeness]) -> None:
    """One line per model, those that differ marked."""
    width = max([len(row.model) for row in rows], default=5)
    print(f"{'model':{width}}  {'corr.':>6} {'ratio':>6} {'diff.':>6} {'IoU':>6} {'size':>6}  differs")
    for row in rows:
        figures = (row.correlation, row.ratio, row.difference, row.overlap, row.extent)
        shown = " ".join("     -" if np.isnan(figure) else f"{figure:6.3f}" for figure in figures)
        said = "; ".join(part for part in (row.differs or "no", row.ours and f"ours: {row.ours}",
                                           row.theirs and f"theirs: {row.theirs}") if part)
        print(f"{row.model:{width}}  {shown}  {said}")
    count = sum(bool(row.differs) for row in rows)
    print(f"\n{len(rows)} models, {count} differ: overlap of masks below {LEAST_OVERLAP:g}, correlation below "
          f"{LEAST_CORRELATION:g}, ratio or size off by more than {MOST_OFF:g}, or albedo by as much")


def write_csv(path: Path, rows: Sequence[Likeness]) -> None:
    """One line per model."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=[*(field.name for field in fields(Likeness)), "differs"])
        writer.writeheader()
        writer.writerows({**asdict(row), "differs": row.differs} for row in rows)
