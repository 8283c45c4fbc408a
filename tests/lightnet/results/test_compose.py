"""I_R = I_PBR (1 - M) + M I_t holds to the bit where M is 0 or 1, and rims are filled from the object alone."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.batch import Inputs
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.results.compose import Composite, blend, compose, panels, seen, with_rim
from dataset_builder.lightnet.results.compose_input import PARTS, ComposeInput, input_from_dataset, input_from_files
from dataset_builder.lightnet.settings import DataSpec, TrainingSpec
from dataset_builder.seeding import rng
from dataset_builder.shards import exr
from dataset_builder.shards.reader import open_dataset
from tests.lightnet.formula_method import product, trained
from tests.lightnet.synthetic import write_synthetic

SIZE = 36
ROWS, COLUMNS = np.mgrid[:SIZE, :SIZE]
DISTANCE = np.hypot(ROWS - SIZE / 2, COLUMNS - SIZE / 2)


def light(seed: int, high: float = 2.0) -> np.ndarray:
    """(H, W, 3) radiance."""
    return rng(seed, "light").uniform(0.1, high, (SIZE, SIZE, 3)).astype(np.float32)


@pytest.fixture
def frame() -> ComposeInput:
    """A disc with a soft rim three pixels wide before noise."""
    mask = np.clip((13 - DISTANCE) / 3, 0, 1).astype(np.float32)[..., None]
    return ComposeInput(name="disc", i_s=light(0), s_prime=light(1), mask=mask, background=light(2, 50.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset."""
    return write_synthetic(tmp_path_factory.mktemp("compose") / "synthetic", train=2, held_out=2, size=40)


def test_outside_the_mask_nothing_changes_and_inside_the_prediction_stands(frame: ComposeInput) -> None:
    found = compose(trained(), frame)
    outside, whole = frame.mask[..., 0] == 0, frame.mask[..., 0] == 1
    assert outside.sum() > 500 and whole.sum() > 200
    assert np.array_equal(found.picture[outside], frame.background[outside])
    assert np.array_equal(found.picture[whole], found.i_t[whole])
    assert np.allclose(found.i_t[whole], (frame.i_s * frame.s_prime)[whole], rtol=1e-5)
    assert found.picture.dtype == np.float32 and not found.i_t[outside].any()


def test_in_between_it_is_the_mean_weighted_by_the_mask(frame: ComposeInput) -> None:
    found, mask = compose(trained(), frame), frame.mask.astype(np.float64)
    expected = frame.background * (1 - mask) + mask * found.i_t
    assert ((mask > 0) & (mask < 1)).sum() > 100
    assert np.allclose(found.picture, expected, rtol=1e-6)


def test_mixing_is_exact_at_both_ends() -> None:
    mask = np.array([[[0.0], [1.0], [0.25]]], np.float32)
    background = np.array([[[1e-30] * 3, [3e38] * 3, [8.0] * 3]], np.float32)
    i_t = np.array([[[3e38] * 3, [1e-30] * 3, [4.0] * 3]], np.float32)
    assert blend(background, i_t, mask)[0, :, 0].tolist() == [np.float32(1e-30), np.float32(1e-30), 7.0]


def test_the_rim_is_what_the_prediction_does_not_cover(frame: ComposeInput) -> None:
    found, mask = compose(trained(), frame), frame.mask[..., 0]
    assert np.array_equal(found.predicted, mask >= 0.5)
    assert np.array_equal(found.filled, (mask > 0) & (mask < 0.5))
    assert found.filled.sum() > 20 and found.i_t[found.filled].min() > 0


def test_pixels_without_light_of_the_rough_mesh_are_filled(frame: ComposeInput) -> None:
    dark = frame.s_prime.copy()
    dark[15:17, 18:21] = 0
    by_light = compose(trained(), replace(frame, s_prime=dark))
    assert by_light.filled[15:17, 18:21].all() and by_light.i_t[15:17, 18:21].min() > 0
    rough = np.ones_like(frame.mask)
    rough[20, 18] = 0
    by_mask = compose(trained(), replace(frame, s_prime=dark, mask_rough=rough))
    assert by_mask.predicted[15, 18] and not by_mask.i_t[15, 18].any()
    assert by_mask.filled[20, 18] and by_mask.i_t[20, 18].min() > 0


def test_what_is_behind_the_object_is_not_drawn_into_its_rim(frame: ComposeInput) -> None:
    """A grey object in front of a hundred times its light: its rim stays grey."""
    grey = replace(frame, i_s=np.full_like(frame.i_s, 0.5), s_prime=np.ones_like(frame.i_s),
                   background=np.full_like(frame.i_s, 100))
    found = compose(trained(), grey)
    assert np.allclose(found.i_t[frame.mask[..., 0] > 0], 0.5, rtol=1e-4)


def test_highlights_beside_the_rim_do_not_leave_the_range(frame: ComposeInput) -> None:
    hot = frame.s_prime.copy()
    hot[(DISTANCE > 9) & (COLUMNS > 18)] = 5000
    found = compose(trained(), replace(frame, s_prime=hot))
    assert np.isfinite(found.picture).all() and found.i_t.min() >= 0
    assert found.i_t[found.filled].max() <= found.i_t[found.predicted].max() * 1.001


def test_predicted_light_is_not_cut_at_what_display_values_hold() -> None:
    exposed = np.where(DISTANCE[..., None] < 5, np.float32(1e6), light(0))
    known, asked = DISTANCE < 8, (DISTANCE >= 8) & (DISTANCE < 9)
    whole = with_rim(exposed, known, asked)
    assert np.array_equal(whole[~asked], exposed[~asked]) and not np.array_equal(whole[asked], exposed[asked])


def test_light_below_nothing_is_nothing(frame: ComposeInput) -> None:
    found = compose(trained(lambda inputs: inputs.i_s - 1), frame)
    assert found.i_t.min() == 0 and (found.i_t[found.predicted] > 0).any()


def test_stronger_light_makes_a_brighter_picture_of_the_same_kind(frame: ComposeInput) -> None:
    one = compose(trained(), frame)
    other = compose(trained(), replace(frame, s_prime=8 * frame.s_prime, background=8 * frame.background))
    assert other.exposure == pytest.approx(one.exposure / 8, rel=1e-5)
    assert np.allclose(other.picture, 8 * one.picture, rtol=1e-4)


def test_negative_pixels_of_filters_count_as_black(frame: ComposeInput) -> None:
    given = list[Inputs]()

    def watching(inputs: Inputs) -> torch.Tensor:
        given.append(inputs)
        return product(inputs)

    compose(trained(watching), replace(frame, i_s=frame.i_s - 1, s_prime=frame.s_prime - 1))
    assert given[0].i_s.min() == 0 == given[0].s_prime.min()


def test_pictures_show_what_went_in_and_came_out(frame: ComposeInput) -> None:
    shown = panels(frame, compose(trained(), frame))
    assert list(shown) == ["I_s M", "S' M", "I_t", "I_PBR", "I_R"]
    outside, whole = frame.mask[..., 0] == 0, frame.mask[..., 0] == 1
    assert np.array_equal(shown["I_R"][outside], shown["I_PBR"][outside])
    assert np.array_equal(shown["I_R"][whole], shown["I_t"][whole])
    assert not shown["I_t"][outside].any() and shown["I_s M"].dtype == np.uint8


def test_an_example_predicted_rightly_is_itself(folder: Path) -> None:
    """A method that says I_t gives back the dataset's I_t, but for what the rim's filling changes."""
    frame = input_from_dataset(folder, split="evaluation", index=1)
    example = open_dataset(folder, layers=["i_t", "mask"])["evaluation", 1]

    def told(inputs: Inputs) -> torch.Tensor:
        exposure = inputs.s_prime.sum() / torch.from_numpy(frame.s_prime.transpose(2, 0, 1) * inputs.inside[0].numpy()
                                                           ).sum()
        return torch.from_numpy(example["i_t"].transpose(2, 0, 1))[None] * exposure

    found = compose(trained(told), frame)
    near = ~found.filled
    assert np.allclose(found.picture[near], example["i_t"][near], rtol=1e-4, atol=1e-6)
    assert np.abs(found.picture - example["i_t"])[found.filled].mean() < 0.2 * example["i_t"][found.filled].mean()
    assert example["meta"]["key"] in frame.name


def test_an_example_is_seen_as_in_training(folder: Path) -> None:
    dataset = LightingDataset(folder, "evaluation", DataSpec(source_exposure=0.7))
    frame = input_from_dataset(folder, key=dataset.keys[0])
    batch = seen(frame, frame.mask[..., 0] >= 0.5, source_exposure=0.7)
    expected = dataset[0]
    assert batch.exposure == expected.exposure
    for field in fields(Inputs):
        assert torch.equal(getattr(batch.inputs, field.name), getattr(expected.inputs, field.name)), field.name


def write_files(frame: ComposeInput, folder: Path) -> dict[str, Path]:
    """The frame as EXR files, the mask in Y."""
    paths = {name: folder / f"{name}.exr" for name in ("i_s", "s_prime", "mask", "background")}
    for name, path in paths.items():
        layer = "mask" if PARTS[name] == 1 else "i_t"
        path.write_bytes(exr.encode(getattr(frame, name), layer=layer, key="0", dtype="float32"))
    return paths


def same(one: Composite, other: Composite) -> bool:
    """Whether two composites are the same to the bit."""
    return one.picture.tobytes() == other.picture.tobytes() and np.array_equal(one.filled, other.filled)


def test_files_give_what_arrays_give(frame: ComposeInput, tmp_path: Path) -> None:
    paths = write_files(frame, tmp_path)
    assert same(compose(trained(), input_from_files(paths)), compose(trained(), frame))
    paths["mask"].write_bytes(exr.encode_picture(frame.mask.repeat(3, axis=2), name="mask"))
    assert same(compose(trained(), input_from_files(paths)), compose(trained(), frame))


def test_wrong_files_are_told_by_name(frame: ComposeInput, tmp_path: Path) -> None:
    paths = write_files(frame, tmp_path)
    paths["mask"].write_bytes(exr.encode_picture(light(4), name="colours"))
    with pytest.raises(UserError, match=r"mask.exr: expected a mask, one channel Y or three that are the same"):
        input_from_files(paths)
    with pytest.raises(UserError, match=r"missing.exr: expected an EXR file, got: No such file"):
        input_from_files({**paths, "i_s": tmp_path / "missing.exr"})


def test_what_is_wrong_with_a_file_is_told_of_that_file(frame: ComposeInput, tmp_path: Path) -> None:
    paths = write_files(frame, tmp_path)
    paths["background"].write_bytes(exr.encode_picture(light(4)[:20], name="frame"))
    paths["s_prime"].write_bytes(exr.encode(frame.mask, layer="mask", key="0", dtype="float32"))
    with pytest.raises(UserError) as error:
        input_from_files(paths)
    assert [problem.where for problem in error.value.problems] == [str(paths["s_prime"]), str(paths["background"])]
    assert not any(problem.path for problem in error.value.problems)


def test_all_that_is_wrong_with_a_frame_is_told_at_once(frame: ComposeInput) -> None:
    holed = light(1)
    holed[3, 4] = np.nan
    with pytest.raises(UserError) as error:
        ComposeInput(name="mine", i_s=light(0), s_prime=holed, mask=2 * frame.mask, background=light(2)[:20])
    text = str(error.value)
    assert "mine: s_prime: expected finite values, got 3 that are NaN or Inf" in text
    assert "mine: mask: expected values in [0, 1], got [0, 2]" in text
    assert f"mine: background: expected {SIZE} x {SIZE} pixels as i_s, got {SIZE} x 20" in text


def test_masks_that_show_nothing_are_told(frame: ComposeInput) -> None:
    with pytest.raises(UserError, match=r"expected a mask with a pixel >= 0.5, got at most 0.4"):
        compose(trained(), replace(frame, mask=frame.mask * np.float32(0.4)))
    with pytest.raises(UserError, match="expected the rough mesh inside the mask"):
        compose(trained(), replace(frame, s_prime=np.zeros_like(frame.s_prime)))


def test_methods_that_need_what_files_lack_are_told(frame: ComposeInput) -> None:
    needy = trained(spec=TrainingSpec.model_validate({"method": "dpr"}))
    with pytest.raises(UserError, match=r"got dpr, which needs the scene's light as spherical harmonics"):
        compose(needy, frame)
    assert compose(needy, replace(frame, lighting=np.zeros((3, 9)))).filled.any()


def test_examples_that_are_not_there_are_told(folder: Path) -> None:
    with pytest.raises(UserError, match="expected a split among train, evaluation, got elsewhere"):
        input_from_dataset(folder, split="elsewhere")
    with pytest.raises(UserError, match="expected an index from 0 to 1 in split evaluation, got 2"):
        input_from_dataset(folder, split="evaluation", index=2)
    with pytest.raises(UserError, match="expected the key of an example, such as 00000000, got 77"):
        input_from_dataset(folder, key="77")


def test_datasets_without_a_scene_are_told(tmp_path: Path, folder: Path) -> None:
    bare = write_synthetic(tmp_path / "bare", train=1, held_out=1, size=16, layers=("i_s", "s_prime", "mask"))
    with pytest.raises(UserError, match="a mask and a frame of the scene, i_pbr or i_t or i_t_empty missing"):
        input_from_dataset(bare, split="train")
    manifest = json.loads((folder / "dataset.json").read_text())
    next(layer for layer in manifest["layers"] if layer["name"] == "i_t")["extent"] = "object"
    cut = tmp_path / "cut"
    cut.mkdir()
    (cut / "dataset.json").write_text(json.dumps(manifest))
    with pytest.raises(UserError, match=r"expected the extent frame, .* got object \(build with --set layers.i_t=fr"):
        input_from_dataset(cut, split="train")
