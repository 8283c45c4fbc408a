"""What a table of the paper is made of, and every number of tables 1, 2 and 3 of Cai et al., arXiv 2211.14823 v3.

Numbers stand by the rows' names here. They are of another dataset, other sizes of networks and another length of
training, and the paper says neither in which range nor over which pixels it measures: compare the order, not the
values.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from dataset_builder.lightnet.settings import TrainingSpec

SOURCE = "Cai et al., arXiv 2211.14823 v3"


@dataclass(frozen=True, kw_only=True)
class Printed:
    """One printed row: mean absolute difference, dB, structural similarity, radians."""

    l1: float
    psnr: float
    ssim: float
    lab: float

    def of(self, metric: str) -> float:
        """The number under one metric's name."""
        return float(getattr(self, metric))


FULL = Printed(l1=0.0219, psnr=30.17, ssim=0.9142, lab=0.3137)
"""LighTNet as proposed: the same row stands in all three tables."""

METHODS: Mapping[str, Printed] = {
    "pix2pix": Printed(l1=0.0345, psnr=26.65, ssim=0.9042, lab=0.4314),
    "dpr": Printed(l1=0.0399, psnr=25.39, ssim=0.8692, lab=0.4576),
    "ssvbrdf": Printed(l1=0.0373, psnr=26.02, ssim=0.9040, lab=0.3796),
    "lightnet": FULL,
    "lightnet-dagger": Printed(l1=0.0281, psnr=29.93, ssim=0.9203, lab=0.3173),
}
"""Table 1; the last row is trained on I_s from NeRFs."""

OBJECTIVES: Mapping[str, Printed] = {
    "l1": Printed(l1=0.0277, psnr=28.37, ssim=0.8774, lab=0.3551),
    "fr": Printed(l1=0.0254, psnr=29.06, ssim=0.9006, lab=0.3717),
    "fr-dssim": Printed(l1=0.0229, psnr=29.83, ssim=0.9129, lab=0.3317),
    "fr-dssim-lab": FULL,
    "fr-dssim-lab-l1": Printed(l1=0.0240, psnr=29.37, ssim=0.9102, lab=0.3426),
}
"""Table 2; L_DR is part of every row."""

FORMULATIONS: Mapping[str, Printed] = {
    "d-s": Printed(l1=0.0283, psnr=28.46, ssim=0.9128, lab=0.3449),
    "dr-s": Printed(l1=0.0262, psnr=28.83, ssim=0.9117, lab=0.3411),
    "dr-s-plus-alpha": Printed(l1=0.0238, psnr=29.45, ssim=0.9040, lab=0.3458),
    "full": FULL,
}
"""Table 3, top: how I_t is composed, with S = S' + S'_r."""

SHADINGS: Mapping[str, Printed] = {
    "raw": Printed(l1=0.0260, psnr=28.70, ssim=0.8935, lab=0.3574),
    "direct": Printed(l1=0.0241, psnr=29.35, ssim=0.8996, lab=0.3473),
    "full": FULL,
}
"""Table 3, bottom: S' as it is, S* predicted directly, and S' + S'_r."""

STABILITY: Mapping[str, Printed] = {
    "pix2pix": Printed(l1=0.0366, psnr=27.5716, ssim=0.9167, lab=0.4503),
    "lightnet": Printed(l1=0.0275, psnr=31.7297, ssim=0.9356, lab=0.3275),
}
"""Table of stability: means over 600 views of 360-degree sequences."""

STABILITY_DEVIATIONS: Mapping[str, Printed] = {
    "pix2pix": Printed(l1=0.0081, psnr=1.4850, ssim=0.0168, lab=0.0197),
    "lightnet": Printed(l1=0.0097, psnr=1.9355, ssim=0.0103, lab=0.0114),
}
"""What stands after the ± there; the paper calls it variance, and it is taken as the standard deviation over views."""


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """A row of a table: what is trained for it, and the published row that it is compared with."""

    name: str
    """Of its folder and in files; where nothing is learnt, its name in `lightnet.methods.method`."""
    title: str
    """For people."""
    spec: TrainingSpec | None
    """None for what learns nothing."""
    printed: Printed | None = None
    """None where the paper has no such row."""
    note: str = ""
    """A remark on it."""


@dataclass(frozen=True, kw_only=True)
class Group:
    """Rows that the paper compares with each other, by name; order is looked at within a group."""

    title: str
    rows: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table: its rows, and which of them the paper compares."""

    name: str
    number: str
    """How the paper calls it."""
    question: str
    rows: tuple[TableRow, ...]
    groups: tuple[Group, ...]
    reference: str
    """The row that all others are held against."""
    absent: Mapping[str, tuple[Printed, str]]
    """Printed rows that cannot be measured here, with the reason by title."""
    left_out: tuple[str, ...] = ()
    """What was not asked, and why."""

    def row(self, name: str) -> TableRow:
        """The row of that name."""
        return next(row for row in self.rows if row.name == name)
