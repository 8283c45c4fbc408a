"""Tables 2 and 3, and the weights of the losses: variants of LighTNet that differ in one thing from each other."""

from collections.abc import Mapping
from typing import Any

from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.studies.derived import changed
from dataset_builder.studies.tables import paper
from dataset_builder.studies.tables.row import Group, Table, TableRow, names

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
FACTORS = (0.0, 0.2, 5.0)
"""Times the paper's weight; 1 is the row that all sweeps share."""
NO_WEIGHTS = "FR off: no weights"
NO_NUMBERS = "the paper's numbers, which it shows in a figure alone, measured on a fifth of its dataset"


def objectives(base: TrainingSpec) -> Table:
    """Table 2: which terms the objective has."""
    rows = tuple(TableRow(name=name, title=title, spec=_weighted(base, {term: WEIGHTS[term] for term in terms}),
                     printed=paper.OBJECTIVES[name]) for name, (title, terms) in OBJECTIVES.items())
    return Table(name="objectives", number="Table 2", question="Which losses transfer light best?", rows=rows,
                 groups=(Group(title="objectives", rows=names(rows)),), reference="fr-dssim-lab", absent={})


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
