import json
import pickle
from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
import torch

from dataset_builder.errors import ShardError, UserError
from dataset_builder.geometry.harmonics import basis, irradiance, rotation
from dataset_builder.lightnet.data.assemble import camera_from_world, lighting_of
from dataset_builder.lightnet.data.lighting_dataset import LAYERS, LightingDataset, exposure_of
from dataset_builder.lightnet.data.ranges import luminance
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.shards import exr
from dataset_builder.shards.example import label
from dataset_builder.shards.label_text import encode_label
from dataset_builder.shards.reader import open_dataset
from tests.lightnet.synthetic import PAPER_AND_ROUGH, camera_frame, synthetic_example, write_synthetic
from tests.plans import example_plan
from tests.shards.replaced import exr_of, replace_members

SPEC = DataSpec()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six examples at three noise levels to train on, two held out; not to be changed."""
    return write_synthetic(tmp_path_factory.mktemp("dataset") / "synthetic", train=6, held_out=2, size=32, levels=3)


@pytest.fixture
def own(folder: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(copytree(folder, tmp_path / "own"))


def relabelled(folder: Path, key: str, change: Callable[[dict], None]) -> None:
    """Change the label of an example."""
    label = open_dataset(folder, layers=[])[key]["meta"]
    change(label)
    replace_members(folder, {f"{key}.json": encode_label(label)})


def test_examples_are_the_layers_inside_the_object_exposed(folder: Path) -> None:
    data, raw = LightingDataset(folder, "train", SPEC), open_dataset(folder)
    assert data.keys == raw.splits["train"] and len(data) == 6 and data.size == (32, 32) and data.name == "synthetic"
    for index, key in enumerate(data.keys):
        batch, example = data[index], raw[key]
        inside = example["mask"] >= 0.5
        assert batch.keys == (key,) and np.array_equal(batch.inputs.inside[0, 0].numpy(), inside[..., 0])
        exposure = float(batch.exposure)
        for picture, name, factor in ((batch.inputs.i_s, "i_s", 1), (batch.inputs.s_prime, "s_prime", exposure),
                                      (batch.truth.i_t, "i_t", exposure), (batch.truth.d, "d", 1),
                                      (batch.truth.r, "r", 1)):
            expected = example[name] * inside * np.float32(factor)
            np.testing.assert_allclose(picture[0].permute(1, 2, 0).numpy(), expected, rtol=1e-6, atol=0)
        mean = luminance(batch.inputs.s_prime).sum() / batch.inputs.inside.sum()
        assert float(mean) == pytest.approx(1, abs=1e-5)
        assert data.label(index).model_dump(mode="json") == example["meta"]


def test_the_source_exposure_multiplies_i_s_alone(folder: Path) -> None:
    plain, brighter = (LightingDataset(folder, "train", DataSpec(source_exposure=factor))[1] for factor in (1.0, 4.0))
    assert torch.equal(brighter.inputs.i_s, 4 * plain.inputs.i_s)
    assert torch.equal(brighter.inputs.s_prime, plain.inputs.s_prime) and torch.equal(brighter.truth.d, plain.truth.d)


def test_the_exposure_does_not_depend_on_threads() -> None:
    stream = np.random.default_rng(0)
    s_prime = stream.uniform(0, 3, (3, 200, 300)).astype(np.float32)
    inside, threads = stream.uniform(size=(200, 300)) < 0.3, torch.get_num_threads()
    try:
        found = []
        for number in (1, 2, 3):
            torch.set_num_threads(number)
            found.append(exposure_of(s_prime, inside))
    finally:
        torch.set_num_threads(threads)
    expected = 1 / ([0.2126, 0.7152, 0.0722] @ s_prime[:, inside].astype(float)).mean()
    assert len(set(found)) == 1 and found[0] == pytest.approx(expected, rel=1e-6)


def test_only_layers_that_are_needed_are_decoded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read, decoded = exr.read, []

    def count(data: bytes, *, where: str, most: int) -> exr.ExrImage:
        decoded.append(where.split(".")[1])
        return read(data, where=where, most=most)

    data = LightingDataset(folder, "train", SPEC)
    monkeypatch.setattr(exr, "read", count)
    assert data[0] and sorted(decoded) == sorted(LAYERS) == sorted(set(PAPER_AND_ROUGH) - {"mask_rough"})


def test_noise_levels_are_chosen(folder: Path) -> None:
    whole = LightingDataset(folder, "train", SPEC)
    levels = [whole.label(index).plan.rough.level for index in range(6)]
    assert levels == [0, 1, 2, 0, 1, 2]
    chosen = LightingDataset(folder, "train", SPEC, levels=(2, 0))
    assert chosen.keys == tuple(whole.keys[index] for index in (0, 2, 3, 5))
    with pytest.raises(UserError, match=r"expected noise levels among 0, 1, 2 in split train, got 3, 7"):
        LightingDataset(folder, "train", SPEC, levels=(1, 3, 7))


def test_the_rendered_image_may_stand_for_that_of_a_field(folder: Path, tmp_path: Path) -> None:
    both = write_synthetic(tmp_path / "both", train=2, held_out=1, size=16, layers=(*PAPER_AND_ROUGH, "i_s_clean"))
    seen, clean = LightingDataset(both, "train", SPEC)[0], LightingDataset(both, "train", SPEC, i_s="i_s_clean")[0]
    raw, inside = open_dataset(both)[seen.keys[0]], seen.inputs.inside[0, 0].numpy()[..., None]
    for batch, name in ((seen, "i_s"), (clean, "i_s_clean")):
        assert np.array_equal(batch.inputs.i_s[0].permute(1, 2, 0).numpy(), raw[name] * inside)
    assert not torch.equal(seen.inputs.i_s, clean.inputs.i_s)
    assert torch.equal(seen.inputs.s_prime, clean.inputs.s_prime) and torch.equal(seen.truth.i_t, clean.truth.i_t)
    with pytest.raises(UserError, match=r"expected mask, s_prime, i_s_clean, .* the dataset has no i_s_clean"):
        LightingDataset(folder, "train", SPEC, i_s="i_s_clean")


def test_what_the_dataset_lacks_is_told_together(tmp_path: Path) -> None:
    folder = write_synthetic(tmp_path / "poor", train=1, held_out=1, size=16, layers=("i_s", "i_t", "s_prime", "mask"))
    with pytest.raises(UserError) as caught:
        LightingDataset(folder, "test", SPEC)
    message = str(caught.value)
    assert "the dataset has no d, r (" in message and "expected test, got train, evaluation (" in message


def test_an_empty_split_is_told(tmp_path: Path) -> None:
    folder = write_synthetic(tmp_path / "empty", train=1, held_out=0, size=16)
    with pytest.raises(UserError, match="expected examples in split evaluation, got none"):
        LightingDataset(folder, "evaluation", SPEC)
    with pytest.raises(ShardError, match="expected a finished dataset"):
        LightingDataset(tmp_path, "train", SPEC)


def test_a_split_that_is_not_there_is_told_with_a_remedy(folder: Path, own: Path) -> None:
    """With one split alone, choosing another name is no remedy."""
    with pytest.raises(UserError, match=r"name one of these: .* or --split"):
        LightingDataset(folder, "test", SPEC)
    manifest = json.loads((own / "dataset.json").read_text())
    manifest["splits"] = [split for split in manifest["splits"] if split["name"] == "train"]
    (own / "dataset.json").write_text(json.dumps(manifest))
    with pytest.raises(UserError, match=r"expected evaluation, got train .*add a split to the dataset and build"):
        LightingDataset(own, "evaluation", SPEC)


def test_objects_that_fill_no_pixel_are_left_out_and_counted(own: Path) -> None:
    thin = np.full((32, 32, 1), 0.25)
    files = {f"{key}.mask.exr": exr_of(thin, layer="mask", key=key) for key in ("00000001", "00000004")}
    replace_members(own, files)
    for key in ("00000001", "00000004"):
        relabelled(own, key, lambda label: label["layers"]["mask"].update(max=0.25))
    data = LightingDataset(own, "train", SPEC)
    assert data.keys == ("00000000", "00000002", "00000003", "00000005") and data.left_out == ("00000001", "00000004")
    assert data[1].keys == ("00000002",) and data.label(1).key == "00000002"
    assert data.notes == ("split train: 2 of 6 examples left out because their mask is below 0.5 everywhere: 00000001, "
                          "00000004",)
    lower = LightingDataset(own, "train", DataSpec(inside=0.25))
    assert len(lower) == 6 and not lower.left_out and not lower.notes and float(lower[1].inputs.inside.mean()) == 1
    with pytest.raises(UserError, match=r"got none: 2 of 2 examples left out.*lower `data\.inside`"):
        LightingDataset(own, "train", DataSpec(inside=0.5), levels=(1,))


def test_a_mask_that_is_not_as_its_label_says_is_refused(own: Path) -> None:
    replace_members(own, {"00000003.mask.exr": exr_of(np.zeros((32, 32, 1)), layer="mask", key="00000003")})
    data = LightingDataset(own, "train", SPEC)
    with pytest.raises(ShardError, match="00000003: expected a mask of up to 1, as its label says, got less"):
        data[3]


@pytest.mark.parametrize("layer", LAYERS)
def test_pixels_that_are_not_finite_are_refused_wherever_they_are(own: Path, layer: str) -> None:
    """In a corner, outside the object, where nothing of them would be seen."""
    pixels = open_dataset(own)["00000002"][layer]
    pixels[0, 0, 0] = np.nan
    replace_members(own, {f"00000002.{layer}.exr": exr_of(pixels, layer=layer, key="00000002")})
    data = LightingDataset(own, "train", SPEC)
    assert data[1]
    with pytest.raises(ShardError, match=rf"00000002\.{layer}\.exr: expected finite values, got 1"):
        data[2]


def test_datasets_of_earlier_versions_are_told_apart(own: Path) -> None:
    relabelled(own, "00000000", lambda label: label["record"].pop("lighting_sh"))
    with pytest.raises(UserError, match=r"example 00000000: record\.lighting_sh: .* earlier version \(build it again"):
        LightingDataset(own, "train", SPEC)


def test_changed_bytes_are_found_as_asked(own: Path) -> None:
    shard = sorted((own / "shards").glob("*train*"))[0]
    data = bytearray(shard.read_bytes())
    at = data.index(b"3df-lighting:schema\0string\0", data.index(b"00000001.i_s.exr")) + 32
    data[at - 1] = ord("9")
    shard.write_bytes(data)
    assert LightingDataset(own, "train", DataSpec(verify="size"))[1]
    for spec in (SPEC, DataSpec(verify="member")):
        with pytest.raises(ShardError, match=r"expected SHA-256 .* of 00000001\.i_s\.exr"):
            LightingDataset(own, "train", spec)[1]
    with pytest.raises(ShardError, match="expected SHA-256"):
        LightingDataset(own, "train", DataSpec(verify="shard"))


def test_axes_of_a_camera_by_hand() -> None:
    """From the south, level: x to the right is east, y up is up, z to the viewer is south."""
    tilted = example_plan().camera
    camera = tilted.model_copy(update={"position": (0.0, -2.0, 1.0), "target": (0.0, 0.0, 1.0)})
    assert np.allclose(camera_from_world(camera), [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    frame = camera_from_world(tilted)
    assert np.allclose(frame @ frame.T, np.eye(3)) and np.linalg.det(frame) == pytest.approx(1)
    assert np.allclose(frame, camera_frame(tilted))


def test_the_light_in_the_frame_of_the_camera() -> None:
    """Radiance from a direction is the same number in the camera's frame."""
    example = synthetic_example(3, size=8)
    found, frame = lighting_of(label(example, {})), camera_from_world(example.plan.camera)
    directions = np.random.default_rng(1).normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    world = np.array(example.record.lighting_sh).T @ np.stack(basis(*directions.T))
    assert np.allclose(found @ np.stack(basis(*(directions @ frame.T).T)), world)


def test_the_light_lights_the_object_as_the_picture_shows(tmp_path: Path) -> None:
    """Irradiance on normals in the camera's frame is large where S is; less so with any axis turned round.

    Twelve spheres; the harmonics know no shadow, so that single examples may well do better the wrong way round.
    """
    folder = write_synthetic(tmp_path / "lit", train=24, held_out=0, size=24, layers=("s", *PAPER_AND_ROUGH))
    data, raw = LightingDataset(folder, "train", SPEC), open_dataset(folder, layers=["s", "mask"])
    found = []
    for index in range(1, 24, 2):
        example, sh = raw[data.keys[index]], data[index].inputs.sh[0].T.double().numpy()
        normals, inside = _sphere_normals(example["mask"][..., 0] == 1)
        for axes in ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)):
            lit = irradiance(rotation(np.diag(axes)) @ sh, normals)
            found.append(np.corrcoef(lit.mean(axis=-1), example["s"][inside].mean(axis=-1))[0, 1])
    right, *wrong = np.reshape(found, (12, 4)).mean(axis=0)
    assert right > 0.85 and max(wrong) < 0.75


def _sphere_normals(inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals in the camera's frame of a sphere that is seen as a disc, perspective aside, and its pixels."""
    rows, columns = np.nonzero(inside)
    centre, radius = (rows.mean(), columns.mean()), np.sqrt(inside.sum() / np.pi) + 0.5
    x, y = (columns - centre[1]) / radius, -(rows - centre[0]) / radius
    within = x * x + y * y < 0.95
    x, y = x[within], y[within]
    chosen = np.zeros_like(inside)
    chosen[rows[within], columns[within]] = True
    return np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1), chosen


def test_a_process_is_handed_a_dataset(folder: Path) -> None:
    data = LightingDataset(folder, "train", SPEC, levels=(1,))
    again = pickle.loads(pickle.dumps(data))
    assert again.keys == data.keys and torch.equal(again[1].truth.i_t, data[1].truth.i_t)
    assert again.label(0) == data.label(0)


def test_positions_beyond_the_end_are_refused(folder: Path) -> None:
    data = LightingDataset(folder, "evaluation", SPEC)
    assert len(list(data)) == 2 and data[-1].keys == data[1].keys
    with pytest.raises(IndexError):
        data[2]
