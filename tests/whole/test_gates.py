"""Examples that fail a gate are not shipped, and are told by name and reason; the others are."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.engine import rejected_pixels
from dataset_builder.errors import UserError
from dataset_builder.rendering import view_scenes
from dataset_builder.shards.example import decode_png
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.shards.verify import verify
from tests.small_specs import contents, outcomes_of, records, run_build, slots

STRICT = ("rough.sigma=[0.0, 0.08]", "gates.mask_overlap=0.9", "storage.examples_per_shard=1")
"""Every second example is too rough for the gate, and each has a shard of its own."""


@pytest.fixture(scope="module")
def strict(small_spec: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("strict") / "out"
    run_build(small_spec, folder, *STRICT)
    return folder


def test_the_others_are_shipped(strict: Path) -> None:
    assert [int(key) for key in records(strict)] == [0, 2, 4, 6, 8] and verify(strict) == []
    assert slots(strict) == ["small-v1-test-000000", *(f"small-v1-train-{number:06d}" for number in (0, 2, 4, 6))]


def test_the_manifest_names_them_with_figures(strict: Path) -> None:
    manifest = load_manifest(strict)
    assert [int(item.key) for item in manifest.rejected] == [1, 3, 5, 7, 9] and manifest.totals.rejected == 5
    assert {item.gate for item in manifest.rejected} == {"mask_overlap"}
    assert all(item.reason.startswith("expected intersection over union of mask and mask_rough in [0.9, 1], got 0.")
               for item in manifest.rejected)
    assert {item.view for item in manifest.rejected} == {item.view for item in records(strict).values()}


def test_their_pixels_are_kept_to_be_looked_at(small_spec: Path, strict: Path, tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    kept = sorted((strict / WORK / "rejected").iterdir())
    assert [path.name for path in kept] == [f"{key:08d}.{end}" for key in (1, 3, 5, 7, 9) for end in ("npz", "png")]
    with np.load(kept[0]) as layers:
        assert set(layers) == set(open_dataset(strict).layers)
        assert np.array_equal(layers["i_t"], open_dataset(strict)["00000000"]["i_t"])
    assert decode_png(kept[1].read_bytes()).shape == (20, 48, 3)
    # No more than a few, and none of another spec
    monkeypatch.setattr(rejected_pixels, "MAX_PICTURES", 2)
    run_build(small_spec, tmp_path, *STRICT)
    pictures = tmp_path / WORK / "rejected"
    assert sorted(path.name for path in pictures.iterdir()) == [path.name for path in kept[:4]]
    run_build(small_spec, tmp_path, only=[0])
    assert list(pictures.iterdir()) == []


def test_pixels_that_are_not_finite_are_kept_too(tmp_path: Path) -> None:
    layers = {"i_t": np.full((2, 3, 3), np.nan, np.float32), "mask": np.full((2, 3, 1), np.inf, np.float32)}
    rejected_pixels.keep_pixels(tmp_path, "00000001", layers)
    path = rejected_pixels.pixels_of(tmp_path, "00000001")
    assert path is not None and np.isnan(np.load(path)["i_t"]).all()


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
