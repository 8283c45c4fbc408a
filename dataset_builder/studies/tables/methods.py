"""Table 1: LighTNet against Pix2Pix, DPR and SSVBRDF, reformulated as the paper says, and against untrained baselines.

All methods see the same examples in the same order. Sizes and optimisers are each method's own: a baseline has the
width of its public code, and as many levels as the crop allows up to those of its public code.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.studies.derived import changed
from dataset_builder.studies.tables import paper
from dataset_builder.studies.tables.row import Group, Table, TableRow, names

FULL_BASELINES = 16
"""Width of LighTNet from which on baselines have their public widths; below it they have the same share of them."""


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """A rival. width, downs: of its public code. optimiser: what its authors train with, as far as it is known and a
    spec can say it; anything else is as for LighTNet."""

    title: str
    width: int
    downs: int
    optimiser: Mapping[str, Any]


BASELINES: Mapping[str, Baseline] = {
    # Two hundred epochs, the rate falling to 0 over the latter half; batches of one example do not fit "same examples"
    "pix2pix": Baseline(title="Pix2Pix", width=64, downs=8, optimiser={
        "rate": 2e-4, "betas": (0.5, 0.999), "schedule": "cosine", "warm_up": 0, "clip": 0.0}),
    # How DPR was trained is not public
    "dpr": Baseline(title="DPR", width=16, downs=4, optimiser={}),
    # 1e-4 for the encoder and 2e-4 for the decoders, halved every second epoch
    "ssvbrdf": Baseline(title="SSVBRDF", width=32, downs=6, optimiser={
        "rate": 2e-4, "betas": (0.5, 0.999), "schedule": "cosine"}),
}

TRIVIAL = {"copy_i_s": "I_s as it is", "d_s_prime": "D S', true D", "dr_s_prime": "(D + R) S', true D and R"}
"""Untrained baselines, and their titles in tables."""


def methods(base: TrainingSpec, *, own_optimisers: bool = True) -> Table:
    """The four methods and the three that learn nothing. own_optimisers: False trains all with LighTNet's."""
    trained = [*(_baseline(base, name, own_optimisers) for name in BASELINES),
               TableRow(name="lightnet", title="LighTNet", spec=base, printed=paper.METHODS["lightnet"])]
    trivial = [TableRow(name=name, title=title, spec=None, note="learns nothing") for name, title in TRIVIAL.items()]
    return Table(name="methods", number="Table 1", question="Which method transfers light best?",
                 rows=(*trained, *trivial), groups=(Group(title="methods", rows=names(trained)),), reference="lightnet",
                 absent={"LighTNet, trained on NeRFs": (paper.LIGHTNET_ON_NERF, "I_s of the dataset is rendered")})


def _baseline(base: TrainingSpec, name: str, own_optimiser: bool) -> TableRow:
    baseline = BASELINES[name]
    model = {"width": max(1, baseline.width * min(base.model.width, FULL_BASELINES) // FULL_BASELINES),
             "downs": levels(base, baseline.downs)}
    spec = changed(base, method=name, model=model, optimiser=baseline.optimiser if own_optimiser else {})
    return TableRow(name=name, title=baseline.title, spec=spec, printed=paper.METHODS[name])


def levels(base: TrainingSpec, most: int) -> int:
    """How often a baseline halves the resolution: as often as it can without cutting the crop that LighTNet sees."""
    crop = base.data.crop - base.data.crop % 2**base.model.downs
    return max(downs for downs in range(1, most + 1) if downs == 1 or crop % 2**downs == 0)
