"""Every layer is in the picture of an example, at full size: light at one exposure, the rest as its kind has it."""

import numpy as np

from dataset_builder.layers import LAYERS
from dataset_builder.report.dataset_summary import cell_pixels
from dataset_builder.report.example_sheet import MARGIN
from dataset_builder.report.layer_tiles import SMALL, layer_tile, layer_tiles
from dataset_builder.report.picture_tiles import SPACE, colours_of
from dataset_builder.seeding import rng
from dataset_builder.tonemap import exposure, to_8bit

SIZE = (40, 60)
TIMES = SMALL // SIZE[1]
Images = dict[str, np.ndarray]


def made_up() -> Images:
    """Light, an error and a depth of which a quarter is nowhere."""
    draw = rng(3, "layers")
    depth = np.linspace(1, 5, SIZE[0] * SIZE[1]).reshape(*SIZE, 1)
    depth[:10] = 0
    return {"i_t": draw.gamma(2.0, 3.0, (*SIZE, 3)), "i_s": draw.gamma(2.0, 30.0, (*SIZE, 3)),
            "i_t_se": 1000 * draw.random((*SIZE, 3)), "depth": depth, "mask": draw.random((*SIZE, 1))}


def places(page: np.ndarray, pixels: np.ndarray) -> int:
    """How often a picture is on the page, every pixel `TIMES` times as large."""
    large = pixels.repeat(TIMES, axis=0).repeat(TIMES, axis=1)
    starts = np.argwhere((page[:-large.shape[0] + 1, :-large.shape[1] + 1] == large[0, 0]).all(axis=2))
    return sum(np.array_equal(page[row:row + large.shape[0], column:column + large.shape[1]], large)
               for row, column in starts.tolist())


def test_light_has_one_exposure_which_errors_do_not_change() -> None:
    images = made_up()
    page, factor = np.asarray(layer_tiles(images, ["title"])), exposure([images["i_s"], images["i_t"]])
    for name in ("i_s", "i_t"):
        assert places(page, to_8bit(images[name], factor)) == 1
    assert places(page, cell_pixels("mask", images["mask"], 1.0)) == 1


def test_a_denoised_layer_says_so() -> None:
    images = {"i_t": np.full((20, 700, 3), 0.5), "i_s": np.full((20, 700, 3), 0.5)}
    plain = np.asarray(layer_tiles(images, ["title"]))
    planned = layer_tiles({**images, "meta": {"plan": {"render": {"denoise": ["i_s"]}}}}, ["title"])
    errors = [{"name": "i_t", "relative_error": 0.25}]
    known = layer_tiles({**images, "meta": {"record": {"layers": errors}}}, ["title"])
    both = layer_tiles({**images, "meta": {"record": {"layers": errors, "denoised": [{"layer": "i_t"}]}}}, ["title"])
    assert np.asarray(planned).shape[0] > plain.shape[0], "a line more"
    assert np.asarray(known).shape == np.asarray(both).shape
    differ = (np.asarray(known) != np.asarray(both)).any(axis=(0, 2)).nonzero()[0]
    assert differ.size
    assert differ.min() > 700 + MARGIN, "below i_t alone, which stands second"


def test_errors_and_lengths_are_in_false_colour() -> None:
    """Between 0 and the 99th percentile, and between the percentiles 0.5 and 99.5 of what is somewhere."""
    images = made_up()
    page, errors = np.asarray(layer_tiles(images, ["title"])), images["i_t_se"]
    share = np.clip(errors.max(axis=2) / np.percentile(errors, 99), 0, 1)
    assert places(page, colours_of("magma")[np.rint(255 * share).astype(int)]) == 1
    depth = images["depth"][..., 0]
    low, high = np.percentile(depth[depth > 0], [0.5, 99.5])
    shown = colours_of("viridis")[np.rint(255 * np.clip((depth - low) / (high - low), 0, 1)).astype(int)]
    assert places(page, np.where(depth[..., None] > 0, shown, 0).astype(np.uint8)) == 1


def test_large_layers_stay_as_they_are_and_fewer_stand_beside_each_other() -> None:
    """Two rows: d beside r, then the mask."""
    wide = {name: np.full((20, 700, LAYERS[name].channels), 0.5) for name in ("d", "r", "mask")}
    page, grey = np.asarray(layer_tiles(wide, ["title"])), to_8bit(np.full((1, 1, 3), 0.5))[0, 0]
    covered = (page == grey).all(axis=2).sum(axis=1)
    assert page.shape[1] == 2 * 700 + SPACE + 2 * MARGIN
    assert np.count_nonzero(covered >= 1400) == 20 and np.count_nonzero(covered >= 700) == 40


def test_what_is_not_finite_is_told_and_counts_for_no_range() -> None:
    image = np.array([[[1.0], [np.nan]], [[np.inf], [3.0]]])
    lines = layer_tile("mask", image, 1.0, None, 1).lines
    assert lines == ["1 to 3, mean 2", "2 values are infinite or no number"]


def test_what_is_not_finite_or_empty_is_drawn() -> None:
    broken = {"i_t": np.full((8, 8, 3), np.nan), "depth": np.zeros((8, 8, 1)), "i_t_se": np.zeros((8, 8, 3))}
    assert np.asarray(layer_tiles(broken, ["title"])).shape[2] == 3
