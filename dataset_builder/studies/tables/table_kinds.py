"""The tables: methods (table 1), objectives (2), formulations (3), the weights of the losses, losses that expect noise,
and stability.

All methods see the same examples in the same order. Sizes and optimisers are each method's own: a baseline has the
width of its public code, and as many levels as the crop allows up to those of its public code. The other tables have
variants of LighTNet that differ in one thing from each other.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.studies.tables import paper
from dataset_builder.studies.tables.paper import Group, Table, TableRow
from dataset_builder.studies.trainings import changed

FULL_BASELINES = 16
"""Width of LighTNet from which on baselines have their public widths; below it they have the same share of them."""


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """A rival."""

    title: str
    width: int
    """Of its public code."""
    downs: int
    """Of its public code."""
    optimiser: Mapping[str, Any]
    """What its authors train with, as far as it is known and a spec can say it; anything else is as for LighTNet."""


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

DAGGER, DAGGERS = "lightnet-dagger", "LighTNet†, trained on I_s of fields"
NO_FIELDS = "needs a training split whose i_s is the image of fields, and i_s_clean beside it"

TERMS = ("fr", "dssim", "lab", "l1")
"""Terms that table 2 takes in and leaves out; L_DR is always in."""

OBJECTIVES: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "l1": ("L1", ("l1",)),
    "fr": ("FR", ("fr",)),
    "fr-dssim": ("FR + DSSIM", ("fr", "dssim")),
    "fr-dssim-lab": ("FR + DSSIM + Lab", ("fr", "dssim", "lab")),
    "fr-dssim-lab-l1": ("FR + DSSIM + Lab + L1", ("fr", "dssim", "lab", "l1")),
}

WEIGHTS = {"dr": 1.0, "fr": 0.05, "dssim": 0.5, "lab": 0.5, "l1": 1.0}
"""The paper's weights; that of L1 is not printed and ours."""

FORMULATIONS = {
    "d-s": ("D S", "d_s", "residual"), "dr-s": ("(D + R) S", "dr_s", "residual"),
    "dr-s-plus-alpha": ("(D + R) S + α", "dr_s_plus_alpha", "residual"),
    "raw": ("(D + R + α) S'", "dr_alpha_s", "raw"), "direct": ("(D + R + α) S*", "dr_alpha_s", "direct"),
    "full": ("(D + R + α) (S' + S'_r)", "dr_alpha_s", "residual"),
}
"""Title, formulation and shading; the last row is that of both halves."""

LAMBDAS = {"fr": "λ1 (FR)", "dssim": "λ2 (DSSIM)", "lab": "λ3 (Lab)"}
NOISES = {"plain": "noise ignored", "weighted": "weighted by standard errors", "two_samples": "two samples"}
FACTORS = (0.0, 0.2, 5.0)
"""Times the paper's weight; 1 is the row that all sweeps share."""
NO_WEIGHTS = "FR off: no weights"
NO_NUMBERS = "the paper's numbers, which it shows in a figure alone, measured on a fifth of its dataset"


def methods(base: TrainingSpec, *, own_optimisers: bool = True, fields: bool = False) -> Table:
    """The four methods and the three that learn nothing. own_optimisers: False trains all with LighTNet's.

    fields: whether I_s of the training split is the image of fields, with a rendered one beside it. All train on the
    latter, then LighTNet on the former, as the paper has it.
    """
    dagger, base = base, changed(base, data={"i_s": "i_s_clean"}) if fields else base
    trained = [*(_baseline(base, name, own_optimisers) for name in BASELINES),
               TableRow(name="lightnet", title="LighTNet", spec=base, printed=paper.METHODS["lightnet"])]
    if fields:
        trained.append(TableRow(name=DAGGER, title=DAGGERS, spec=dagger, printed=paper.METHODS[DAGGER]))
    trivial = [TableRow(name=name, title=title, spec=None, note="learns nothing") for name, title in TRIVIAL.items()]
    return Table(name="methods", number="Table 1", question="Which method transfers light best?",
                 rows=(*trained, *trivial), reference="lightnet",
                 groups=(Group(title="methods", rows=tuple(row.name for row in trained)),),
                 absent={} if fields else {DAGGERS: (paper.METHODS[DAGGER], NO_FIELDS)})


def stability(base: TrainingSpec, *, own_optimisers: bool = True) -> Table:
    """Pix2Pix and LighTNet on views that follow each other, and two that learn nothing."""
    rows = (replace(_baseline(base, "pix2pix", own_optimisers), printed=paper.STABILITY["pix2pix"]),
            TableRow(name="lightnet", title="LighTNet", spec=base, printed=paper.STABILITY["lightnet"]),
            *(TableRow(name=name, title=TRIVIAL[name], spec=None, note="learns nothing")
              for name in ("copy_i_s", "dr_s_prime")))
    return Table(name="stability", number="Table of stability", question="How steady are methods from view to view?",
                 rows=rows, reference="lightnet", groups=(Group(title="methods", rows=tuple(paper.STABILITY)),),
                 absent={})


def _baseline(base: TrainingSpec, name: str, own_optimiser: bool) -> TableRow:
    baseline = BASELINES[name]
    model = {"width": max(1, baseline.width * min(base.model.width, FULL_BASELINES) // FULL_BASELINES),
             "downs": halvings(base, baseline.downs)}
    spec = changed(base, method=name, model=model, optimiser=baseline.optimiser if own_optimiser else {})
    return TableRow(name=name, title=baseline.title, spec=spec, printed=paper.METHODS[name])


def halvings(base: TrainingSpec, most: int) -> int:
    """How often a baseline halves the resolution: as often as it can without cutting the crop that LighTNet sees."""
    crop = base.data.crop - base.data.crop % 2**base.model.downs
    return max(downs for downs in range(1, most + 1) if downs == 1 or crop % 2**downs == 0)


def objectives(base: TrainingSpec) -> Table:
    """Table 2: which terms the objective has."""
    rows = tuple(TableRow(name=name, title=title, spec=_weighted(base, {term: WEIGHTS[term] for term in terms}),
                     printed=paper.OBJECTIVES[name]) for name, (title, terms) in OBJECTIVES.items())
    return Table(name="objectives", number="Table 2", question="Which losses transfer light best?", rows=rows,
                 groups=(Group(title="objectives", rows=tuple(OBJECTIVES)),), reference="fr-dssim-lab", absent={})


def formulations(base: TrainingSpec) -> Table:
    """Table 3: how I_t is composed (top), and where S comes from (bottom)."""
    printed = {**paper.FORMULATIONS, **paper.SHADINGS}
    rows = tuple(TableRow(name=name, title=title, printed=printed[name],
                     spec=changed(base, model={"formulation": formulation, "shading": shading}))
                 for name, (title, formulation, shading) in FORMULATIONS.items())
    groups = (Group(title="composition, S = S' + S'_r", rows=tuple(paper.FORMULATIONS)),
              Group(title="learning S'_r or not", rows=tuple(paper.SHADINGS)))
    return Table(name="formulations", number="Table 3", question="Which formula transfers light best?", rows=rows,
                 groups=groups, reference="full", absent={})


def losses_of_noise(base: TrainingSpec) -> Table:
    """What the objective makes of the truth's noise: nothing, or what the shards know of it."""
    rows = tuple(TableRow(name=name, title=title, spec=changed(base, objective={"noise": name}))
                 for name, title in NOISES.items())
    return Table(name="noise", number="Losses that expect noise", rows=rows, groups=(), reference="plain", absent={},
                 question="Does it pay to tell the losses of the truth's noise?")


def weights(base: TrainingSpec, *, vgg: bool) -> Table:
    """Each of the three weights changed alone. Without VGG's weights FR is off and its weight changes nothing."""
    centre = _weighted(base, {term: WEIGHTS[term] for term in LAMBDAS})
    paper_row = TableRow(name="paper", title="the paper's weights", spec=centre)
    rows = [paper_row, *(_swept(centre, term, factor) for term in LAMBDAS if vgg or term != "fr"
                         for factor in FACTORS)]
    groups = tuple(Group(title=title, rows=(*(row.name for row in rows if row.name.startswith(f"{term}-")), "paper"))
                   for term, title in LAMBDAS.items() if vgg or term != "fr")
    return Table(name="weights", number="Figure of the loss weights", question="How much do the loss weights matter?",
                 rows=tuple(rows), groups=groups, reference="paper", absent={},
                 left_out=(NO_NUMBERS, *(() if vgg else (f"λ1: {NO_WEIGHTS}, so it changes nothing",))))


def _swept(centre: TrainingSpec, term: str, factor: float) -> TableRow:
    weight = WEIGHTS[term] * factor
    return TableRow(name=f"{term}-{weight:g}", title=f"{LAMBDAS[term]} = {weight:g}",
               spec=changed(centre, objective={term: weight}))


def _weighted(base: TrainingSpec, terms: Mapping[str, float]) -> TrainingSpec:
    """L_DR and these terms, nothing else."""
    values: dict[str, Any] = {"dr": WEIGHTS["dr"], **dict.fromkeys(TERMS, 0.0), **terms}
    return changed(base, objective=values)
