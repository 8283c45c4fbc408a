"""Sampled examples as planned and with everything simulated: differences, seconds, decisions, and tables of them."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from dataset_builder.label.example_plan import Decision
from dataset_builder.layers import LAYERS
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import Rendered
from dataset_builder.studies.comma_separated import write_csv
from dataset_builder.studies.effects.picture_differences import Difference, clear_difference, noisy_difference
from dataset_builder.studies.image_errors import geometric_mean
from dataset_builder.studies.renders import Warm, render
from dataset_builder.studies.sampled import StudySpec, reseeded

COMMON = ("render.accuracy={}", "render.denoise={}", "storage.standard_errors=true")
"""Equal samples on both sides, and errors to judge by."""

ALL = "render.effects=all"
REPEATS = 4
"""Renderings of each side, with samples of their own."""
DEEPER, DEEP = 4, 128
"""Times the edges of the longest paths that were planned, and the least number, where everything is simulated."""

DIFFERENCE_COLUMNS = (*(field.name for field in fields(Difference)), "smallest", "verdict")
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
    depth = max(DEEP, DEEPER * max(entry.max_depth for entry in plan.effects.passes))
    whole = study.spec.plan(ref, *COMMON, ALL, f"render.max_depth={depth}")
    sides = []
    for name, one in (("planned", plan), ("everything", whole)):
        warm.up(name, one, root)
        sides.append([render(reseeded(one, name, number), root) for number in range(REPEATS)])
    planned, everything = sides
    pairs = [_difference(name, planned, everything, allowed) for name, _ in plan.render.layers if _judged(name)]
    return Compared(example=plan.key, planned=_seconds(planned), everything=_seconds(everything),
                    decisions=plan.effects.decisions, differences=tuple(pairs))


def _seconds(repeats: Sequence[Rendered]) -> dict[str, float]:
    """By pass, the least of several renderings: what else the machine does only ever adds."""
    return {name: min(one.seconds[name] for one in repeats) for name in repeats[0].seconds}


def _judged(layer: str) -> bool:
    """Errors judge others, and identifiers have no mean."""
    return not layer.endswith("_se") and layer != "instance"


def _difference(layer: str, planned: Sequence[Rendered], everything: Sequence[Rendered], allowed: float) -> Difference:
    plan, both = planned[0].plan, (*planned, *everything)
    keep = np.ones(planned[0].layers[layer].shape[:2], dtype=bool)
    if dict(plan.render.layers)[layer] == "object":
        # On a pixel that one of them does not see the object in, there is nothing to compare
        keep = np.all([one.layers["mask"][..., 0] > 0 for one in both], axis=0)
    ours, all_on = ([one.layers[layer][keep] for one in side] for side in (planned, everything))
    if not LAYERS[layer].radiometric:
        return clear_difference(plan.key, layer, ours, all_on, allowed=allowed)
    variance = sum(one.layers[f"{layer}_se"][keep].astype(np.float64) ** 2 for one in both) / REPEATS**2
    together = any(side[0].plan.effects.of(LAYERS[layer].render_pass).transport == "joined"
                   for side in (planned, everything))
    return noisy_difference(plan.key, layer, ours, all_on, np.asarray(variance), allowed=allowed,
                            batches=plan.render.batches, together=together)


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
    # One example may say the same of several things, for reasons of their own
    count = Counter(said for one in found for said in {(each.effect, each.choice) for each in one.decisions})
    reasons = {(decision.effect, decision.choice): decision.reason for one in found for decision in one.decisions}
    return {key: (number, reasons[key]) for key, number in sorted(count.items())}


def write_tables(found: Sequence[Compared], folder: Path) -> None:
    """`differences.csv`, one row per example and layer, and `seconds.csv`, one per example and pass. Raises
    OutputError."""
    write_csv(folder / "differences.csv", DIFFERENCE_COLUMNS, [
        [*astuple(one), one.smallest, one.verdict] for compared in found for one in compared.differences])
    write_csv(folder / "seconds.csv", SECONDS_COLUMNS, [
        [one.example, name, one.planned.get(name, 0.0), one.everything.get(name, 0.0)]
        for one in found for name in dict.fromkeys((*one.planned, *one.everything))])
