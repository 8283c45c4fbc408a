"""Pages of the examples that `build --example` staged, or refused."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import PlanError
from dataset_builder.planning.plan import Planner
from dataset_builder.report.one_example import ExampleFiles, write_example, write_rejected
from dataset_builder.shards import exr
from dataset_builder.shards.example import LABEL
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.label_text import read_label
from dataset_builder.shards.segment_members import members_of
from dataset_builder.shards.staging import Staging
from dataset_builder.spec.resolve import LoadedSpec

EXAMPLES = "examples"
"""Folder of the pages, below `.build`."""


def look_at_outcomes(outcomes: Iterable[Outcome], loaded: LoadedSpec, folder: Path,
                     staging: Staging) -> Iterator[tuple[str, ExampleFiles]]:
    """Write the page of every outcome below `.build/examples`: its key, and where.

    A rejected example has the gate and its figures on top, and the pixels that were kept of it, if any. Raises
    OutputError, ShardError where what was staged is damaged.
    """
    out, planner = folder / WORK / EXAMPLES, Planner(loaded)
    about = f"{loaded.dataset.title or loaded.dataset.name} {loaded.dataset.version}"
    for outcome in outcomes:
        key = outcome.ref.key
        if not outcome.rejected:
            example = staged_layers(staging.get(key, outcome.digest).segment)
            yield key, write_example(example, key, out, lead=[about], note="staged, not published")
            continue
        yield key, write_rejected(outcome.rejected, folder, out, about=about, plan=_plan(planner, outcome))


def staged_layers(segment: bytes) -> dict[str, Any]:
    """What `Dataset` would give for a staged example, of its bytes in a shard: layers, and the label under `meta`.
    Raises ShardError where they are damaged."""
    found: dict[str, Any] = {}
    for name, data in members_of(segment):
        suffix = name.partition(".")[2]
        if suffix == LABEL:
            found["meta"] = read_label(data, where="staged", name=name)
        elif suffix.endswith(".exr"):
            found[suffix.removesuffix(".exr")] = exr.decode(data, where=name)
    return found


def _plan(planner: Planner, outcome: Outcome) -> dict[str, Any] | None:
    """The plan of an example, where it has one."""
    try:
        return planner.example(outcome.ref).model_dump(mode="json")
    except PlanError:
        return None
