"""No damage goes unnoticed: a smaller form of what the tool prints."""

from pathlib import Path

import pytest

from tests.shards.tiny_dataset import build, contents
from tools import damage_dataset
from tools.damage_dataset import DEPTHS, Row, main

BY_SIZE = ("cut", "missing", "twice", "renamed", "too many", "dataset.json")
"""Words of the kinds that names, sizes and the manifest's own sum tell."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("damage") / "tiny"
    build(folder)
    return folder


def test_each_depth_sees_its_kinds_and_all_of_them_and_repair_mends_them(dataset: Path) -> None:
    before = contents(dataset)
    rows = list(damage_dataset.damage_dataset(dataset, payload=8, small=4, step=23))
    assert len(rows) == 19 and all(row.tried for row in rows)
    for row in rows:
        seen = [row.seen[depth] for depth in DEPTHS]
        assert seen == sorted(seen) and seen[-1] == row.tried and row.mended == row.repairs, row
        assert (seen[0] == row.tried) == any(word in row.kind for word in BY_SIZE), row
        assert (row.repairs == 0) == ("renewed" in row.kind), row
        # Only sums that were renewed hide something from the second depth, those of an index from the third
        assert (seen[1] == row.tried) == ("renewed" not in row.kind) and (seen[2] == 0) == ("index renewed" in row.kind)
    assert contents(dataset) == before


def test_what_was_missed_is_the_exit_code(dataset: Path, monkeypatch: pytest.MonkeyPatch,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    row = Row(kind="a bit", tried=3, seen=dict.fromkeys(DEPTHS, 2), repairs=1, mended=1)
    monkeypatch.setattr(damage_dataset, "damage_dataset", lambda folder, **sizes: iter([row]))
    assert main([str(dataset)]) == 1
    assert "| a bit | 3 | 2 | 2 | 2 | 2 | 1 of 1 |" in capsys.readouterr().out
