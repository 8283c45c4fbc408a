"""Examples that fail a gate are not shipped, and are told by name and reason; the others are."""

from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.rendering import view_scenes
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.shards.verify import verify
from tests.small_specs import contents, outcomes_of, records, run_build

STRICT = ("rough.sigma=[0.0, 0.08]", "gates.mask_overlap=0.9", "storage.examples_per_shard=1")
"""Every second example is too rough for the gate, and each has a shard of its own."""


@pytest.fixture(scope="module")
def strict(small_spec: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("strict") / "out"
    run_build(small_spec, folder, *STRICT)
    return folder


def test_the_others_are_shipped(strict: Path) -> None:
    assert [int(key) for key in records(strict)] == [0, 2, 4, 6, 8] and verify(strict) == []
    assert [path.name for path in sorted((strict / "shards").iterdir())] == [
        "small-v1-test-000000.tar", *(f"small-v1-train-{number:06d}.tar" for number in (0, 2, 4, 6))]


def test_the_manifest_names_them_with_figures(strict: Path) -> None:
    manifest = load_manifest(strict)
    assert [int(item.key) for item in manifest.rejected] == [1, 3, 5, 7, 9] and manifest.totals.rejected == 5
    assert {item.gate for item in manifest.rejected} == {"mask_overlap"}
    assert all(item.reason.startswith("expected intersection over union of mask and mask_rough in [0.9, 1], got 0.")
               for item in manifest.rejected)
    assert {item.view for item in manifest.rejected} == {item.view for item in records(strict).values()}


def test_a_build_that_goes_on_neither_forgets_nor_repeats_them(small_spec: Path, strict: Path, tmp_path: Path,
                                                               capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    run_build(small_spec, folder, *STRICT, only=[0, 1])
    assert [path.name.split(".")[0] for path in (folder / WORK / "staging").glob("*.json")] == ["00000000"]
    again = outcomes_of(run_build(small_spec, folder, *STRICT, only=[1]))
    assert again[1].kept and again[1].rejected and again[1].rejected.gate == "mask_overlap"

    command = [part for override in STRICT for part in ("--set", override)]
    assert main(["build", str(small_spec), "--out", str(folder), "--workers", "1", "--backend", "llvm", *command]) == 0
    said = capsys.readouterr().out
    assert [f"rejected {index:08d} (mask_overlap): expected intersection over union" in said
            for index in range(10)] == [index % 2 == 1 for index in range(10)]
    assert contents(folder) == contents(strict)


def test_a_split_without_any_example_is_refused(small_spec: Path, tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    command = ["build", str(small_spec), "--out", str(tmp_path), "--workers", "1", "--set",
               "gates.coverage=[0.9, 0.95]", "--set", "splits.train.objects.count=1", "--set", "splits.train.lights=1"]
    for _ in range(2):
        assert main(command) == 2
        said = capsys.readouterr().err.splitlines()
        assert said[0].startswith("error: split train: expected at least one example that passes all gates, got none")
        assert said[1].startswith("error: 00000000: coverage: expected share of the frame under the mask in [0.9, 0.9")
        assert len(said) == 3
        assert not (tmp_path / "dataset.json").exists()


def test_a_view_that_cannot_be_planned_is_rejected(small_spec: Path, tmp_path: Path) -> None:
    """With one draw per camera some views fail; the splits still have others."""
    run_build(small_spec, tmp_path, "camera.attempts=1", "camera.coverage=[0.3, 0.33]", "splits.train.views=4",
              "splits.test.views=4", "splits.train.lights=1", "rough.sigma=0.0", "render.spp=4",
              "layers={mask: object}")
    rejected = load_manifest(tmp_path).rejected
    assert rejected and {item.gate for item in rejected} == {"planning"} and verify(tmp_path) == []
    assert all("expected a camera that sees the object" in item.reason for item in rejected)
    assert len(open_dataset(tmp_path)) + len(rejected) == 12


def test_half_that_cannot_hold_a_value_rejects_the_example(small_spec: Path, tmp_path: Path) -> None:
    bright = ("storage.dtype=float16", "target.strength=3e7", "target.brightness=[0, 1e9]",
              "gates.s_prime_energy=[0, 1e9]")
    outcome = outcomes_of(run_build(small_spec, tmp_path, *bright, only=[0]))[0]
    assert outcome.rejected and outcome.rejected.gate == "range"
    assert "expected at most 65504, what float16 holds" in outcome.rejected.reason


def test_a_mesh_beyond_all_bounds_rejects_its_example_and_no_other(small_spec: Path, tmp_path: Path,
                                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise UserError("edges of at most 1e-05 m need 9000000 faces")

    monkeypatch.setattr(view_scenes, "rough_twin", refuse)
    outcomes = outcomes_of(run_build(small_spec, tmp_path, only=[0, 1]))
    assert [outcomes[index].rejected and outcomes[index].rejected.gate for index in (0, 1)] == ["rendering"] * 2
    monkeypatch.undo()
    assert outcomes_of(run_build(small_spec, tmp_path, only=[4]))[4].rejected is None
