"""Sampled examples as planned and with everything simulated: differences, seconds, decisions, and tables of them."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from dataset_builder.label.example_plan import Decision, ExamplePlan
from dataset_builder.layers import LAYERS
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import Rendered
from dataset_builder.studies.comma_separated import write_csv
from dataset_builder.studies.effects.picture_differences import Difference, clear_difference, noisy_difference
from dataset_builder.studies.image_errors import geometric_mean
from dataset_builder.studies.renders import Warm, timed
from dataset_builder.studies.sampled import StudySpec, rerendered, reseeded

COMMON = ("render.accuracy={}", "render.denoise={}", "storage.standard_errors=true")
"""Equal samples on both sides, and errors to judge by."""

ALL = "render.effects=all"

DIFFERENCE_COLUMNS = (*(field.name for field in fields(Difference)), "verdict")
SECONDS_COLUMNS = ("example", "pass", "planned", "everything")


@dataclass(frozen=True, kw_only=True)
class EffectsStudy:
    """What to study."""

    spec: StudySpec
    out: Path
    """The study's folder."""
    examples: int
    """How many."""
    backend: str


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One example both ways."""

    example: str
    planned: dict[str, float]
    """Seconds by pass."""
    everything: dict[str, float]
    """Seconds by pass."""
    decisions: tuple[Decision, ...]
    """What planning decided."""
    differences: tuple[Difference, ...]

    @property
    def ratio(self) -> float:
        """Seconds with everything on over seconds as planned."""
        return sum(self.everything.values()) / sum(self.planned.values())


def run(study: EffectsStudy) -> Iterator[Compared]:
    """Render and compare, one example at a time. Raises UserError where the spec or its plans do not allow it."""
    activate(study.backend)
    warm = Warm()
    for ref in study.spec.sample(study.examples):
        yield _compare(study, ref, warm)


def _compare(study: EffectsStudy, ref: ExampleRef, warm: Warm) -> Compared:
    root, allowed = study.spec.mesh_root, study.spec.dataset.render.bias
    plan = study.spec.plan(ref, *COMMON)
    whole = reseeded(study.spec.plan(ref, *COMMON, ALL), "everything")
    for name, one in (("planned", plan), ("everything", whole)):
        warm.up(name, one, root)
    planned, everything, again = timed(plan, root), timed(whole, root), timed(_light_free(plan), root, repeats=1)
    pairs = [_difference(name, planned, everything, again, allowed) for name, _ in plan.render.layers if _judged(name)]
    return Compared(example=plan.key, planned=planned.seconds, everything=everything.seconds,
                    decisions=plan.effects.decisions, differences=tuple(pairs))


def _light_free(plan: ExamplePlan) -> ExamplePlan:
    """Layers without light alone, from other samples."""
    layers = tuple((name, extent) for name, extent in plan.render.layers if not LAYERS[name].radiometric)
    return rerendered(reseeded(plan, "again"), layers=layers)


def _judged(layer: str) -> bool:
    """Errors and halves judge others, and identifiers have no mean."""
    return LAYERS[layer].of in ("", layer.removesuffix("_raw")) and layer != "instance"


def _difference(layer: str, planned: Rendered, everything: Rendered, again: Rendered,
                allowed: float) -> Difference:
    keep = np.ones(planned.layers[layer].shape[:2], dtype=bool)
    if dict(planned.plan.render.layers)[layer] == "object":
        # On a pixel that only one of them sees the object in, there is nothing to compare
        keep = (planned.layers["mask"][..., 0] > 0) & (everything.layers["mask"][..., 0] > 0)
    ours, all_on = (found.layers[layer][keep] for found in (planned, everything))
    key = planned.plan.key
    if not LAYERS[layer].radiometric:
        return clear_difference(key, layer, ours, all_on, again.layers[layer][keep], allowed=allowed)
    variance = sum(found.layers[f"{layer}_se"][keep].astype(np.float64) ** 2 for found in (planned, everything))
    return noisy_difference(key, layer, ours, all_on, np.asarray(variance), allowed=allowed,
                            batches=planned.plan.render.batches)


def saving(found: Sequence[Compared]) -> float:
    """Times the seconds that everything on takes: geometric mean over examples."""
    return geometric_mean(one.ratio for one in found)


def seconds_by_pass(found: Sequence[Compared]) -> dict[str, tuple[float, float]]:
    """By pass, seconds per example as planned and with everything on."""
    names = dict.fromkeys(name for one in found for name in (*one.planned, *one.everything))
    return {name: (float(np.mean([one.planned.get(name, 0.0) for one in found])),
                   float(np.mean([one.everything.get(name, 0.0) for one in found]))) for name in names}


def decisions(found: Sequence[Compared]) -> dict[tuple[str, str], tuple[int, str]]:
    """By effect and choice, in how many examples it was decided, and the reason in one of them."""
    count = Counter((decision.effect, decision.choice) for one in found for decision in one.decisions)
    reasons = {(decision.effect, decision.choice): decision.reason for one in found for decision in one.decisions}
    return {key: (number, reasons[key]) for key, number in sorted(count.items())}


def write_tables(found: Sequence[Compared], folder: Path) -> None:
    """`differences.csv`, one row per example and layer, and `seconds.csv`, one per example and pass. Raises
    OutputError."""
    write_csv(folder / "differences.csv", DIFFERENCE_COLUMNS, [
        [*astuple(one), "pass" if one.holds else "fail"] for compared in found for one in compared.differences])
    write_csv(folder / "seconds.csv", SECONDS_COLUMNS, [
        [one.example, name, one.planned.get(name, 0.0), one.everything.get(name, 0.0)]
        for one in found for name in dict.fromkeys((*one.planned, *one.everything))])
