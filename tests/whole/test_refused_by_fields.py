"""Examples that a field refuses leave the others of their shard where they are."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from dataset_builder import builder
from dataset_builder.engine.unit import BuildJob, Outcome
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.shards.manifest import Rejected
from tests.small_specs import outcomes_of, records, run_build


def test_a_shard_of_which_a_field_refuses_one_has_the_rest(small_spec: Path, tmp_path: Path,
                                                           monkeypatch: pytest.MonkeyPatch) -> None:
    def refusing(job: BuildJob, refs: Sequence[ExampleRef], *rest: Any, **named: Any) -> Iterator[tuple[Outcome, ...]]:
        first = next(ref for ref in refs if ref.index == 1)
        refused = Rejected(key=first.key, view=first.view.name, gate="field", reason="blurred")
        yield (Outcome(ref=first, rejected=refused),)

    monkeypatch.setattr(builder, "make_fields", refusing)
    events = run_build(small_spec, tmp_path / "out")
    assert sorted(outcomes_of(events)) == list(range(10))
    assert sorted(map(int, records(tmp_path / "out"))) == [0, *range(2, 10)]
