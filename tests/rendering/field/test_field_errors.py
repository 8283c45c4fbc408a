"""Images that no field can be fitted to are told, with figures and what to do; large ones are read one at a time."""

from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.field import field_pixels
from dataset_builder.rendering.field.field_pixels import chosen_images, fit_pixels
from tests.rendering.field.ball_views import CENTRE, RADIUS, SETTINGS, ball_images, fitted, sphere_directions

QUICK = replace(SETTINGS, resolution=32, steps=12)


def refused(images: PosedImages, match: str) -> None:
    with pytest.raises(UserError, match=match):
        fitted(images, images, QUICK)


def few() -> PosedImages:
    return ball_images(sphere_directions(8), size=24)


def test_too_few_or_too_small_images_are_told() -> None:
    refused(ball_images(sphere_directions(7), size=16), "at least 8 images, got 7")
    refused(ball_images(sphere_directions(8), size=15), "at least 16 pixels along a side of images, got 15 x 15")


def test_images_without_an_object_are_told() -> None:
    images = few()
    refused(replace(images, pixels=np.zeros_like(images.pixels)), "got 8 whose opacity is 0 all over")


def test_masks_without_a_common_object_are_told() -> None:
    """A small ball that is at another border of every other image."""
    images = ball_images(sphere_directions(8), size=24, ball=0.2)
    moved = np.stack([np.roll(pixels, 9 * (-1) ** k, axis=k // 2 % 2) for k, pixels in enumerate(images.pixels)])
    refused(replace(images, pixels=moved), "whose masks have no point of the ball in common")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_pixels_that_are_not_finite_are_told(value: float) -> None:
    images = few()
    images.pixels[3, 12, 12, 1] = value
    refused(replace(images, names=tuple(f"photo{k}.png" for k in range(8))), r"photo3\.png: expected finite pixels")


def test_a_fit_that_explodes_is_told() -> None:
    images = few()
    images.pixels[..., :3] *= 1e30
    refused(images, "got a loss of (inf|nan) after 1 of 12 steps")


def test_many_images_are_thinned_and_never_held_at_once(tmp_path: Path) -> None:
    images = few()
    mapped = np.memmap(tmp_path / "many", np.float16, "w+", shape=(1000, 24, 24, 4))
    mapped[:] = np.concatenate([images.pixels] * 125)
    many = PosedImages(pixels=mapped, poses=np.tile(images.poses, (125, 1, 1)), focal=np.tile(images.focal, (125, 1)),
                       centre=np.tile(images.centre, (125, 1)))
    chosen = chosen_images(1000)
    assert len(chosen) == 300 and (chosen[0], chosen[-1]) == (0, 999) and np.diff(chosen).max() <= 4
    with patch.object(field_pixels, "MOST_PIXELS", 3000):
        pixels = fit_pixels(many, chosen, centre=np.array(CENTRE), radius=RADIUS, white=1.0, seed=1, where="x")
    assert pixels.count == 3000
    # Colours are those of the pixels that they are said to be
    corner, image = np.array(pixels.corner), chosen[np.array(pixels.image)]
    assert np.array_equal(np.array(pixels.colour).reshape(-1, 4), mapped[image, corner >> 16, corner & 0xFFFF])
