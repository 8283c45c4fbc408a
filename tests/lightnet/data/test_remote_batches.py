"""Training from an address: the batches of the local folder, bit by bit, whatever the server does meanwhile."""

from dataclasses import fields
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import ShardError
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.loader import training_batches
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.remote.patience import Patience
from tests.fault_proxy import Fault, Plan, fault_proxy
from tests.file_servers import range_server
from tests.lightnet.synthetic import write_synthetic

EXAMPLES, STEPS = 5, 6
FAULTS: tuple[Fault, ...] = ("truncated", "shifted", "flipped", "error", "busy", "stall", "reset", "changed", "whole")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five examples to train on, two held out; not to be changed."""
    return write_synthetic(tmp_path_factory.mktemp("remote") / "synthetic", train=EXAMPLES, held_out=2, size=24)


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("dataset_builder.remote.open_place.PATIENCE",
                        Patience(attempts=4, stall=0.3, first=0.001, longest=0.01))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def _spec(workers: int = 0, **data: object) -> TrainingSpec:
    return TrainingSpec.model_validate({"seed": 3, "steps": STEPS, "data": {"batch": 2, "crop": 16, "workers": workers,
                                                                            **data}})


def _batches(where: Path | str, spec: TrainingSpec) -> list[tuple[object, ...]]:
    """Two epochs and a bit, bit by bit."""
    found: list[Batch] = list(training_batches(LightingDataset(where, "train", spec.data), spec, multiple=16))
    return [(batch.keys, *(tensor.numpy().tobytes() for part in (batch.inputs, batch.truth) for field in fields(part)
                           if (tensor := getattr(part, field.name)) is not None)) for batch in found]


@pytest.mark.parametrize("workers", [0, 2])
def test_batches_are_those_of_the_folder_under_all_faults(folder: Path, workers: int) -> None:
    plan = Plan(rate=0.0, only=r"\.tar", seed=workers)
    with range_server(folder) as upstream, fault_proxy(upstream, plan) as address:
        spec, plan.faults = _spec(workers), FAULTS[:-1]
        plan.rate = 0.6
        assert _batches(address, spec) == _batches(folder, spec)
    assert len({one.fault for one in plan.served}) > 4


@pytest.mark.parametrize("kept", [{"cache_gb": 0}, {"cache_gb": 2e-5}])
def test_batches_are_the_same_without_a_cache_and_with_one_too_small(folder: Path, kept: dict[str, float]) -> None:
    with range_server(folder) as address:
        assert _batches(address, _spec(**kept)) == _batches(folder, _spec())


def test_a_batch_is_fetched_at_once(folder: Path, tmp_path: Path) -> None:
    """Every stretch of an example once, however many epochs there are."""
    with range_server(folder) as upstream, fault_proxy(upstream, plan := Plan(rate=0.0)) as address:
        spec = _spec(cache=str(tmp_path / "mine"))
        first = _batches(address, spec)
        sent = [one for one in plan.served if one.path.endswith(".tar") and one.sent > 1]
        assert len(sent) == len({one.range + one.path for one in sent})
        before = len(plan.served)
        assert _batches(address, spec) == first
        assert not [one for one in plan.served[before:] if one.path.endswith(".tar") and one.sent > 1]


def test_a_server_that_fails_for_good_ends_the_training_with_a_reason(folder: Path) -> None:
    plan = Plan(rate=0.0, faults=["error"], in_a_row=99, only=r"\.tar")
    with range_server(folder) as upstream, fault_proxy(upstream, plan) as address:
        for workers in (0, 1):
            spec = _spec(workers, cache_gb=0)
            plan.rate = 0.0
            examples = LightingDataset(address, "train", spec.data)
            plan.rate = 1.0
            with pytest.raises(ShardError, match=r"\.tar: cannot be read .HTTP status 503; tried 4 times"):
                list(training_batches(examples, spec, multiple=16))


def test_verbs_take_addresses_or_refuse_them_by_name(folder: Path, tmp_path: Path,
                                                     capsys: pytest.CaptureFixture[str]) -> None:
    def said(*arguments: str, code: int) -> str:
        try:
            found = main(list(arguments))
        except SystemExit as error:
            found = int(str(error.code))
        assert found == code, arguments
        captured = capsys.readouterr()
        return captured.out + captured.err

    with range_server(folder) as address:
        shown, secret = address, address.replace("//", "//me:secret@")
        text = said("inspect", secret, code=0)
        assert "synthetic" in text.lower() and "none, say --sheet FILE" in text
        assert "contact sheet:" in said("inspect", secret, "--sheet", str(tmp_path / "sheet.png"), code=0)
        tiny = ("--set", "model={width: 2, downs: 1}", "--set", "data={batch: 2, crop: 16, workers: 0}",
                "--device", "cpu")
        said("train", secret, "--set", "steps=2", *tiny, "--out", str(tmp_path / "run"), code=0)
        said("evaluate", secret, "--checkpoint", str(tmp_path / "run" / "last.pt"), "--device", "cpu", code=0)
        text = said("validate", secret, "--only", "loader", "--out", str(tmp_path / "gate"), code=0)
        assert "secret" not in text + (tmp_path / "gate" / "report.md").read_text()
        assert "--only consistency,loader,training" in said("validate", secret, code=2)
        for verb in ("verify", "export-usd"):
            more = ("--example", "00000000") if verb == "export-usd" else ()
            text = said(verb, secret, *more, code=2)
            assert f"got the address {shown}: fetch it first" in text and "secret" not in text
        assert "its pictures are written there" in said("inspect", secret, "--sequence", "a", code=2)
