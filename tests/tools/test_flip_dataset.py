"""A flipped bit never goes unnoticed: a bounded version of what the tool counts."""

from pathlib import Path

import pytest

from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.verify import verify
from tests.shards.tiny_dataset import build, contents
from tools import flip_dataset
from tools.flip_dataset import main

COUNTS = {"manifest": 30, "index": 30, "payload": 50, "seal": 400}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    build(tmp_path_factory.mktemp("flips") / "tiny")
    return tmp_path_factory.getbasetemp() / "flips0" / "tiny"


def test_every_flip_is_caught_and_the_dataset_stays_as_it_was(dataset: Path) -> None:
    before = contents(dataset)
    found = flip_dataset.flip_dataset(dataset, COUNTS)
    assert [(one.kind, one.check, one.silent) for one in found] == [
        *((kind, check, ()) for kind in ("manifest", "index", "payload") for check in ("verify", "reader")),
        ("seal", "staging", ())]
    assert all(one.caught == COUNTS[one.kind] for one in found)
    assert contents(dataset) == before and verify(dataset) == []


def test_what_a_reader_lets_through_is_counted(dataset: Path, monkeypatch: pytest.MonkeyPatch,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(flip_dataset, "open_dataset", lambda folder: open_dataset(folder, verify="off"))
    assert main([str(dataset), "--manifest", "0", "--index", "0", "--payload", "60", "--seal", "0"]) == 1
    line, = (line for line in capsys.readouterr().out.splitlines() if line.startswith("payload, reader"))
    assert " 0 silent" not in line and ".tar:" in line
