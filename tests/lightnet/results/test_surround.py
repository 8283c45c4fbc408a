"""What is about an object: the frame where neither mesh is, the scene without it behind the rim, and its shadow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.lightnet.results.compose import blend, compose
from dataset_builder.lightnet.results.compose_input import ComposeInput, input_from_dataset
from dataset_builder.lightnet.results.surround import surround
from dataset_builder.seeding import rng
from tests.lightnet.formula_method import trained
from tests.lightnet.synthetic import write_synthetic

SIZE = 36
ROWS, COLUMNS = np.mgrid[:SIZE, :SIZE]
DISTANCE = np.hypot(ROWS - SIZE / 2, COLUMNS - SIZE / 2)
MASK = np.clip((10 - DISTANCE) / 3, 0, 1).astype(np.float32)[..., None]
OBJECT = np.full((SIZE, SIZE, 3), 4.0, np.float32)
FLOOR = rng(0, "floor").uniform(0.5, 1.5, (SIZE, SIZE, 3)).astype(np.float32)


def scene(thrown: float) -> ComposeInput:
    """A disc of radiance 4 on a floor of many colours, from which it takes `thrown` everywhere."""
    shadowed = FLOOR - np.float32(thrown)
    return ComposeInput(name="disc", i_s=OBJECT, s_prime=np.ones_like(OBJECT), mask=MASK, empty=FLOOR,
                        background=blend(shadowed, OBJECT, MASK))


def test_with_the_empty_scene_the_rim_is_exact_where_without_it_the_object_shines_through() -> None:
    """The frame holds M I + (1 - M) B in the rim; put there again, I counts twice: M (1 - M) (I - B) too much."""
    frame, rim = scene(0.25), (MASK > 0) & (MASK < 1)
    truth = frame.background
    assert rim.sum() > 100
    exact = blend(surround(frame), OBJECT, MASK)
    assert np.allclose(exact, truth, atol=1e-5) and np.array_equal(exact[MASK[..., 0] == 0], truth[MASK[..., 0] == 0])
    paper = blend(surround(replace(frame, empty=None)), OBJECT, MASK)
    expected = MASK * (1 - MASK) * (OBJECT - (FLOOR - np.float32(0.25)))
    assert np.allclose(paper - truth, np.where(rim, expected, 0), atol=1e-5)


def test_the_shadow_may_be_left_out_and_never_takes_more_than_there_is() -> None:
    frame, about, rim = scene(0.25), MASK[..., 0] < 1, (MASK[..., 0] > 0) & (MASK[..., 0] < 1)
    assert np.array_equal(surround(frame, shadow=False), FLOOR)
    assert np.allclose((surround(frame) - FLOOR)[about], -0.25, atol=1e-5)
    assert surround(scene(2.0))[rim].min() == 0 and surround(scene(2.0))[~about].min() == 4


def test_what_the_rough_mesh_covers_beside_the_mask_is_not_taken_for_shadow() -> None:
    """A rough mesh two pixels wider than M stands in the frame; nothing of it is left."""
    frame = scene(0.25)
    rough = np.clip((12 - DISTANCE) / 3, 0, 1).astype(np.float32)[..., None]
    pbr = blend(FLOOR - np.float32(0.25), OBJECT, rough)
    found = surround(replace(frame, background=pbr, mask_rough=rough))
    assert np.allclose(found[MASK[..., 0] < 1], (FLOOR - 0.25)[MASK[..., 0] < 1], atol=1e-5)
    assert np.abs(surround(replace(frame, background=pbr)) - (FLOOR - 0.25))[DISTANCE < 12].max() > 1


def test_a_frame_that_the_object_fills_has_no_shadow_to_see() -> None:
    full = replace(scene(0.25), mask=np.full_like(MASK, 0.5))
    assert np.array_equal(surround(full), FLOOR)


def test_a_scene_without_the_object_is_enough_and_none_is_refused() -> None:
    frame = scene(0.25)
    alone = compose(trained(), replace(frame, background=None))
    assert np.array_equal(alone.picture[MASK[..., 0] == 0], FLOOR[MASK[..., 0] == 0])
    assert np.array_equal(alone.background, FLOOR)
    with pytest.raises(UserError, match="disc: background: expected a frame of the scene, got none"):
        replace(frame, background=None, empty=None)
    with pytest.raises(UserError, match=r"expected the scene without the object to leave its shadow out, got none "
                                        r"\(build with --set layers.i_t_empty=frame"):
        surround(replace(frame, empty=None), shadow=False)


@pytest.mark.parametrize(("layers", "background", "empty"), [
    (("i_s", "s_prime", "mask_rough", "i_t_empty", "i_pbr"), "i_pbr", "i_t_empty"),
    (("i_s", "s_prime", "mask_rough", "i_t_empty"), None, "i_t_empty"),
    (("i_s", "s_prime", "mask", "i_t", "i_pbr"), "i_pbr", None)])
def test_a_capture_has_no_truth_and_is_composed_all_the_same(layers: tuple[str, ...], background: str | None,
                                                             empty: str | None, tmp_path: Path) -> None:
    """Without a clean mesh the mask is the rough one's; the frame is that with the rough mesh, or the empty scene."""
    folder = write_synthetic(tmp_path / "capture", train=1, held_out=1, size=24, layers=layers)
    frame = input_from_dataset(folder, split="evaluation")
    assert (frame.background is None, frame.empty is None) == (background is None, empty is None)
    assert np.array_equal(frame.mask, frame.mask_rough) if "mask" not in layers else frame.mask_rough is None
    assert compose(trained(), frame).predicted.any()
