

from dataclasses import replace
from itertools import chain

import numpy as np
import pytest
import torch

from dataset_builder.geometry.harmonics import basis
from dataset_builder.lightnet.data.assemble import MIRROR, ExamplePart, Shape, assemble, batch_of, fill, planes_of
from dataset_builder.lightnet.data.augment import (
    STILL,
    Draw,
    Variation,
    Window,
    draws_of,
    epoch_draws,
    epoch_order,
    variation_of,
    window_about,
    window_side,
)
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.seeding import rng

HEIGHT, WIDTH = 20, 26
SPEC = DataSpec(crop=16)


def part(seed: int = 0, *, spec_is_zero: bool = False) -> ExamplePart:
    """An example with s_prime = S and I_t = D S + spec in whole numbers over powers of two: sums have no rounding."""
    stream = rng(seed, "part")

    def colours(top: int) -> np.ndarray:
        return (stream.integers(1, top, (HEIGHT, WIDTH, 3)) / 64).astype(np.float32)

    inside = np.zeros((HEIGHT, WIDTH), bool)
    inside[4:15, 6:17] = stream.uniform(size=(11, 11)) < 0.8
    inside[4, 6] = inside[14, 16] = True
    d, s, spec = colours(64), colours(128), colours(32) * (not spec_is_zero)
    layers = {"i_s": colours(64), "d": d, "r": colours(8), "i_t": d * s + spec, "s_prime": s}
    return ExamplePart(key="00000007", layers=[(name, planes_of(picture)) for name, picture in layers.items()],
                       inside=inside, exposure=0.5, source_exposure=2.0, lighting=stream.normal(size=(3, 9)))


def batch(one: ExamplePart, variation: Variation, window: Window) -> Batch:
    """The batch of one example."""
    return assemble([(one, variation, window)], Shape(count=1, height=window.height, width=window.width))


WHOLE = Window(top=0, left=0, height=HEIGHT, width=WIDTH)
POWERS = Variation(mirrored=False, gain=(2.0, 0.5, 4.0))


def test_unvaried_pictures_are_the_layers_inside_the_object_exposed() -> None:
    one = part()
    found, layers = batch(one, STILL, WHOLE), dict(one.layers)
    inside = torch.from_numpy(one.inside)
    assert torch.equal(found.inputs.inside[0, 0], inside.float()) and found.exposure.tolist() == [0.5]
    for picture, name, factor in ((found.inputs.i_s, "i_s", 2.0), (found.inputs.s_prime, "s_prime", 0.5),
                                  (found.truth.i_t, "i_t", 0.5), (found.truth.d, "d", 1.0), (found.truth.r, "r", 1.0)):
        expected = torch.from_numpy(np.stack(layers[name])) * factor * inside
        assert torch.equal(picture[0], expected) and picture.dtype == torch.float32, name
    assert torch.equal(found.inputs.sh[0], torch.from_numpy((one.lighting * 0.5).astype(np.float32)))


@pytest.mark.parametrize("mirrored", [False, True])
def test_radiance_stays_diffuse_plus_specular(mirrored: bool) -> None:
    """I_t - D S' is the specular part times what the light was multiplied by, to the last bit with powers of two."""
    one, variation = part(), replace(POWERS, mirrored=mirrored)
    window = Window(top=3, left=5, height=16, width=16)
    plain, varied = (batch(one, which, window) for which in (replace(STILL, mirrored=mirrored), variation))
    residual, before = (found.truth.i_t - found.truth.d * found.inputs.s_prime for found in (varied, plain))
    assert before.abs().max() > 0
    assert torch.equal(residual, before * torch.tensor(POWERS.gain)[:, None, None])


def test_diffuse_surfaces_stay_diffuse_whatever_is_drawn() -> None:
    one = part(spec_is_zero=True)
    spec = DataSpec(exposure=2, colour=0.5)
    for draws in epoch_draws(30, 1, 2):
        found = batch(one, variation_of(spec, draws), WHOLE)
        torch.testing.assert_close(found.truth.i_t, found.truth.d * found.inputs.s_prime, rtol=3e-7, atol=0)


def test_the_light_is_varied_on_both_sides_and_materials_are_not() -> None:
    one = part()
    plain, varied = batch(one, STILL, WHOLE), batch(one, POWERS, WHOLE)
    gain = torch.tensor(POWERS.gain)
    for before, after in ((plain.inputs.s_prime, varied.inputs.s_prime), (plain.truth.i_t, varied.truth.i_t)):
        assert torch.equal(after, before * gain[:, None, None])
    assert torch.equal(varied.inputs.sh, plain.inputs.sh * gain[:, None])
    assert torch.equal(varied.truth.d, plain.truth.d) and torch.equal(varied.truth.r, plain.truth.r)
    assert torch.equal(varied.inputs.i_s, plain.inputs.i_s) and torch.equal(varied.exposure, plain.exposure)


def test_mirror_images_are_mirrored_all_of_them_and_twice_is_not_at_all() -> None:
    one, mirrored = part(), replace(STILL, mirrored=True)
    plain, found = batch(one, STILL, WHOLE), batch(one, mirrored, WHOLE)
    for name in ("i_s", "s_prime", "inside"):
        assert torch.equal(getattr(found.inputs, name), getattr(plain.inputs, name).flip(-1))
    for name in ("i_t", "d", "r"):
        assert torch.equal(getattr(found.truth, name), getattr(plain.truth, name).flip(-1))
    assert torch.equal(found.inputs.sh, plain.inputs.sh * torch.from_numpy(MIRROR).float())
    assert np.array_equal(MIRROR * MIRROR, np.ones(9))


def test_the_light_of_a_mirrored_world() -> None:
    """The mirrored light from (x, y, z) is the light from (-x, y, z)."""
    coefficients, directions = rng(0, "sh").normal(size=9), rng(0, "w").normal(size=(40, 3))
    x, y, z = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
    assert np.allclose((coefficients * MIRROR) @ np.stack(basis(x, y, z)), coefficients @ np.stack(basis(-x, y, z)))
    assert sorted(np.flatnonzero(MIRROR < 0)) == [3, 4, 7]


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_window_beyond_the_picture_is_filled_with_nothing(mirrored: bool) -> None:
    """Whatever was in the memory before."""
    variation, shape = replace(STILL, mirrored=mirrored), Shape(count=1, height=32, width=32)
    memory = torch.full((shape.numbers,), torch.nan)
    chosen = [(part(), variation, Window(top=0, left=0, height=32, width=32))]
    found = batch_of(memory, fill(memory, chosen, shape), shape)
    plain = batch(part(), variation, WHOLE)
    for large, small in ((found.truth.i_t, plain.truth.i_t), (found.inputs.inside, plain.inputs.inside)):
        assert torch.equal(large[..., :HEIGHT, :WIDTH], small)
        assert not large[..., HEIGHT:, :].any() and not large[..., :, WIDTH:].any()


def test_draws_are_in_range_and_reach_its_ends() -> None:
    """1,000 draws: a mirror image in two has a standard deviation of 1.6%; each end is missed once in 10,000 times."""
    found = [variation_of(DataSpec(exposure=1, colour=0.2), draws) for draws in epoch_draws(1000, 0, 0)]
    gains = np.array([one.gain for one in found])
    assert 0.43 < np.mean([one.mirrored for one in found]) < 0.57
    assert 0.5 * 0.8 <= gains.min() < 0.5 and 1.9 < gains.max() <= 2 * 1.2
    ratios = gains[:, 0] / gains[:, 1]
    assert 0.8 / 1.2 <= ratios.min() < 0.72 and 1.4 < ratios.max() <= 1.2 / 0.8
    places = np.array([(*one.place, one.pixel) for one in found])
    assert places.min() >= 0 and places.max() < 1 and (np.abs(places.mean(axis=0) - 0.5) < 0.04).all()


def test_what_is_switched_off_moves_nothing_else() -> None:
    draws = epoch_draws(200, 0, 1)
    plain = [variation_of(DataSpec(), one) for one in draws]
    still = [variation_of(DataSpec(flips=False, exposure=0, colour=0), one) for one in draws]
    assert all(one.gain == (1, 1, 1) and not one.mirrored for one in still)
    assert [(one.place, one.pixel) for one in still] == [(one.place, one.pixel) for one in plain]
    lit = [variation_of(DataSpec(flips=False), one) for one in draws]
    assert [one.gain for one in lit] == [one.gain for one in plain]


def test_examples_and_epochs_are_varied_differently() -> None:
    first, again, other = epoch_draws(20, 0, 0), epoch_draws(20, 0, 0), epoch_draws(20, 0, 1)
    assert np.array_equal(first, again) and len(np.unique(np.concatenate([first, other]))) == 2 * first.size


@pytest.mark.parametrize(("crop", "height", "width", "multiple", "side"), [
    (128, 128, 128, 16, 128), (128, 100, 300, 16, 96), (64, 128, 128, 16, 64), (50, 128, 128, 16, 48),
    (16, 128, 128, 64, 64), (128, 40, 40, 64, 64), (128, 300, 300, 256, 256), (33, 100, 100, 1, 33),
])
def test_sides_of_windows(crop: int, height: int, width: int, multiple: int, side: int) -> None:
    assert window_side(crop, height, width, multiple=multiple) == side


def windows(inside: np.ndarray, side: int) -> list[Window]:
    """As 300 draws place them."""
    return [window_about(inside, side, variation_of(SPEC, draws)) for draws in epoch_draws(300, 0, 0)]


def test_an_object_that_fits_is_in_the_window_whole_anywhere_in_it() -> None:
    inside = np.zeros((40, 60), bool)
    inside[10:18, 30:35] = True
    found = windows(inside, 16)
    assert all(one.top <= 10 and one.top + 16 >= 18 and one.left <= 30 and one.left + 16 >= 35 for one in found)
    assert {one.top for one in found} == set(range(2, 11)) and {one.left for one in found} == set(range(19, 31))


def test_windows_stay_in_the_picture() -> None:
    inside = np.zeros((40, 60), bool)
    inside[0:3, 57:60] = True
    found = windows(inside, 16)
    assert {one.top for one in found} == {0} and {one.left for one in found} == {44}


def test_an_object_that_does_not_fit_is_looked_at_piece_by_piece_never_beside_it() -> None:
    """A large ring: most windows between its ends would be empty."""
    rows, columns = np.mgrid[:64, :64] - 31.5
    radius = np.hypot(rows, columns)
    inside = (radius < 31) & (radius > 29)
    found = windows(inside, 16)
    assert all(inside[one.top:one.top + 16, one.left:one.left + 16].any() for one in found)
    assert all(0 <= one.top <= 48 and 0 <= one.left <= 48 for one in found)
    seen = sum(inside[one.top:one.top + 16, one.left:one.left + 16].any() for one in
               (Window(top=top, left=left, height=16, width=16) for top in range(0, 49, 8) for left in range(0, 49, 8)))
    assert seen < 40 and len({(one.top // 16, one.left // 16) for one in found}) > 8


def test_an_object_that_fits_one_way_only() -> None:
    inside = np.zeros((64, 64), bool)
    inside[5:60, 20:24] = True
    found = windows(inside, 16)
    assert all(one.left <= 20 and one.left + 16 >= 24 for one in found)
    assert min(one.top for one in found) == 0 and max(one.top for one in found) >= 44


def test_a_picture_smaller_than_the_window_is_taken_whole() -> None:
    inside = np.zeros((10, 30), bool)
    inside[2:4, 20:22] = True
    assert all(one.top == 0 and 6 <= one.left <= 14 for one in windows(inside, 16))
    assert set(windows(inside, 32)) == {Window(top=0, left=0, height=32, width=32)}


def test_every_epoch_shows_every_example_once_in_an_order_of_its_own() -> None:
    orders = [epoch_order(50, 3, epoch) for epoch in range(4)]
    assert all(sorted(order) == list(range(50)) for order in orders)
    assert len({tuple(order) for order in orders}) == 4


@pytest.mark.parametrize("size", [1, 4, 7, 23])
def test_batches_are_the_epochs_in_a_row(size: int) -> None:
    """Batches larger than an epoch and epochs that batches do not divide, too: none is ragged, nothing is lost."""
    batches = [draws_of(batch, size=size, count=10, seed=5) for batch in range(30)]
    assert all(len(batch) == size for batch in batches)
    row = list(chain.from_iterable(batches))
    expected = [Draw(epoch=epoch, example=int(example)) for epoch in range(70) for example in epoch_order(10, 5, epoch)]
    assert row == expected[:30 * size]


def test_a_batch_depends_on_its_number_alone() -> None:
    later = draws_of(1000, size=8, count=30, seed=0)
    for batch in range(20):
        draws_of(batch, size=8, count=30, seed=0)
    assert draws_of(1000, size=8, count=30, seed=0) == later != draws_of(1000, size=8, count=30, seed=1)


def test_every_place_is_as_likely_for_every_example() -> None:
    """Chi-squared with 10 x 9 = 90 degrees of freedom over 2,000 epochs: above 150 once in 10,000 seeds."""
    counts = np.zeros((10, 10))
    for epoch in range(2000):
        counts[np.arange(10), epoch_order(10, 11, epoch)] += 1
    assert 40 < ((counts - 200) ** 2 / 200).sum() < 150


def test_an_order_is_not_to_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        epoch_order(5, 0, 0)[0] = 3
