"""Datasets of one split, of three, and of other names: whatever is there is used, and what is missing only named where
it was asked for."""

from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.lightnet.methods.checkpoint import load_trained
from dataset_builder.lightnet.settings import DataSpec, load_training
from dataset_builder.lightnet.training.events import Finished, Started
from dataset_builder.lightnet.training.fit import TrainingJob, fit
from dataset_builder.release.training_checks import loader_checks, training_checks
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.verify import verify
from tests.lightnet.synthetic import write_synthetic

TINY = ("steps=2", "model={width: 4, downs: 2}", "data={crop: 32, batch: 2, workers: 0}", "check.every=1",
        "optimiser.warm_up=0")
KINDS = {"one": {"train": 4}, "three": {"train": 3, "tuning": 2, "final": 2}, "strange": {"stools": 3, "x1": 2}}


@pytest.fixture(scope="module")
def datasets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("data")
    return {name: write_synthetic(folder / name, splits=splits, size=32) for name, splits in KINDS.items()}


def test_which_splits_are_used() -> None:
    assert [(data.train, data.held_out) for data in (
        DataSpec().among(["train", "evaluation", "more"]), DataSpec().among(["train"]), DataSpec().among(["b", "a"]),
        DataSpec().among(["train", "tuning", "final"]), DataSpec(train="evaluation").among(["train", "evaluation"]),
        DataSpec(held_out="test").among(["train"]), DataSpec(train="none").among(["train"]),
        DataSpec().among(["more", "evaluation"]))] == [
        ("train", "evaluation"), ("train", ""), ("b", "a"), ("train", "tuning"), ("evaluation", "train"),
        ("train", "test"), ("none", "train"), ("more", "evaluation")]
    chosen = DataSpec().among(["b", "a"])
    assert chosen.among(["train", "evaluation"]) == chosen


def test_which_split_is_measured() -> None:
    data = DataSpec(train="train", held_out="evaluation")
    assert [data.measured(names) for names in (["train", "evaluation"], ["train", "x"], ["train"], ["b", "a"])] == [
        "evaluation", "x", "train", "b"]


@pytest.mark.parametrize("kind", KINDS)
def test_readers_work_on_whatever_is_there(datasets: dict[str, Path], kind: str, tmp_path: Path) -> None:
    dataset = open_dataset(datasets[kind])
    assert {name: len(keys) for name, keys in dataset.splits.items()} == KINDS[kind]
    assert all(dataset[name, 0]["meta"]["split"] == name for name in KINDS[kind])
    assert verify(datasets[kind]) == []
    assert main(["inspect", str(datasets[kind]), "--sheet", str(tmp_path / "sheet.png")]) == 0


@pytest.mark.parametrize("kind", KINDS)
def test_training_and_measuring_work_on_whatever_is_there(datasets: dict[str, Path], kind: str, tmp_path: Path,
                                                          capsys: pytest.CaptureFixture[str]) -> None:
    out, folder = tmp_path / "out", str(datasets[kind])
    sets = [part for override in TINY for part in ("--set", override)]
    for _ in ("new", "finished"):
        assert main(["train", folder, "--out", str(out), "--device", "cpu", *sets]) == 0
    said = capsys.readouterr().out
    assert ("the dataset has no split to hold out: no checks" in said) == (kind == "one")
    assert (out / "best.pt").exists() == (kind != "one")
    assert main(["evaluate", folder, "--checkpoint", str(out / "last.pt"), "--device", "cpu"]) == 0
    measured = {"one": "train", "three": "tuning", "strange": "x1"}[kind]
    said = capsys.readouterr().out
    assert f"split {measured}" in said and ("A method was trained on this split" in said) == (kind == "one")
    other = list(KINDS[kind])[-1]
    assert main(["evaluate", folder, "--checkpoint", str(out / "last.pt"), "--split", other, "--device", "cpu"]) == 0
    assert f"split {other}" in capsys.readouterr().out


def test_what_was_used_is_in_the_checkpoint(datasets: dict[str, Path], tmp_path: Path) -> None:
    spec = load_training(None, TINY)
    events = list(fit(TrainingJob(dataset=datasets["strange"], out=tmp_path / "out", spec=spec, device="cpu")))
    assert [(event.train, event.held_out) for event in events if isinstance(event, Started)] == [(3, 2)]
    assert [event.best[0] > 0 for event in events if isinstance(event, Finished)] == [True]
    data = load_trained(tmp_path / "out" / "last.pt", "cpu").spec.data
    assert (data.train, data.held_out) == ("stools", "x1")


@pytest.mark.parametrize("asked", ["data.held_out=evaluation", "data.train=training"])
def test_what_is_asked_for_must_be_there(datasets: dict[str, Path], tmp_path: Path, asked: str) -> None:
    spec = load_training(None, [*TINY, asked])
    with pytest.raises(UserError, match=f"expected {asked.partition('=')[2]}, got train"):
        list(fit(TrainingJob(dataset=datasets["one"], out=tmp_path / "out", spec=spec, device="cpu")))


@pytest.mark.parametrize("kind", KINDS)
def test_the_release_gate_reads_whatever_is_there(datasets: dict[str, Path], kind: str) -> None:
    found = loader_checks(datasets[kind], DataSpec())
    assert all(check.holds for check in found)
    assert found[0].detail.startswith(", ".join(f"{name} {count}" for name, count in list(KINDS[kind].items())[:2]))


def test_without_a_split_to_hold_out_nothing_is_compared(datasets: dict[str, Path], tmp_path: Path) -> None:
    job = TrainingJob(dataset=datasets["one"], out=tmp_path / "out", spec=load_training(None, TINY), device="cpu")
    try:
        next(training_checks(job, margin=0.5, copy_margin=3.0))
    except StopIteration as stop:
        checks, rows = stop.value
    assert len(checks) == 6 and not rows and not any(check.judged for check in checks)
    assert not (tmp_path / "out").exists()
