"""Fields of a ball that is known exactly: held-out images, opacity, mesh, radiance; and poses that are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.field.field_figures import looked_at
from dataset_builder.rendering.field.field_fit import FieldSettings
from dataset_builder.rendering.field.field_look import grid_look
from tests.rendering.field.ball_views import (
    BALL,
    CENTRE,
    RADIUS,
    SETTINGS,
    ball_images,
    fitted,
    marble,
    sphere_directions,
)

TRAIN, HELD_OUT = sphere_directions(48), sphere_directions(8, turn=1.0)
SDF = FieldSettings(kind="sdf", resolution=48, steps=150, seed=5)


@pytest.fixture(scope="module")
def density():
    return fitted(ball_images(TRAIN), ball_images(HELD_OUT))


@pytest.fixture(scope="module")
def distance():
    return fitted(ball_images(TRAIN), ball_images(HELD_OUT), SDF)


def off_the_ball(file) -> tuple[np.ndarray, np.ndarray]:
    """Distance of vertices from the ball, in cells; degrees between faces and the ball."""
    out = file.mesh.positions - np.array(CENTRE)
    cell = 2 * RADIUS / len(file.grid)
    normal, middle = file.mesh.area_normals, file.mesh.corners.mean(axis=1) - np.array(CENTRE)
    cosine = (normal * middle).sum(1) / np.linalg.norm(normal, axis=1) / np.linalg.norm(middle, axis=1)
    return (np.linalg.norm(out, axis=1) - BALL * RADIUS) / cell, np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def test_what_was_not_fitted_is_seen(density) -> None:
    record = density.record
    assert record.psnr >= record.psnr_worst and record.psnr >= 28
    assert record.ssim > 0.9 and record.opacity_iou > 0.95 and record.silhouette_iou > 0.93
    assert (record.views, record.held_out, record.width, record.truth) == (48, 8, 64, False)
    assert record.bodies == 1


def test_figures_are_those_of_the_file(density) -> None:
    """A field that went through its file shows images whose figures are in its record."""
    held_out = ball_images(HELD_OUT)
    errors = [np.abs(found[..., 3] - truth[..., 3]).mean() for found, truth in
              zip(looked_at(grid_look(density), held_out, np.arange(8)), held_out.pixels, strict=True)]
    assert np.mean(errors) <= 0.015


def test_the_mesh_is_the_ball(density) -> None:
    off, angle = off_the_ball(density)
    assert abs(np.median(off)) < 1 and np.median(angle) < 20
    edges = np.sort(density.mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    assert density.mesh.volume == pytest.approx(4 / 3 * np.pi * (BALL * RADIUS) ** 3, rel=0.1)


def test_the_mesh_has_the_colours_of_the_ball(density) -> None:
    normal = density.mesh.corners - np.array(CENTRE)
    expected = marble(normal / np.linalg.norm(normal, axis=2, keepdims=True))
    assert np.abs(density.mesh.colors[..., :3] - expected).mean() < 0.05


def test_a_distance_is_smooth_and_where_the_ball_is(density, distance) -> None:
    off, angle = off_the_ball(distance)
    assert abs(off.mean()) < 0.5 and np.median(angle) < 8
    assert np.median(angle) < np.median(off_the_ball(density)[1])
    assert distance.record.psnr >= 28 and distance.record.bodies == 1 and distance.record.level == 0


def test_wrong_poses_do_not_pass() -> None:
    images = ball_images(TRAIN)
    shuffled = np.random.default_rng(0).permutation(len(images.poses))
    wrong = PosedImages(pixels=images.pixels, poses=images.poses[shuffled], focal=images.focal, centre=images.centre)
    assert fitted(wrong, ball_images(HELD_OUT), replace(SETTINGS, steps=45)).record.psnr < 18


def test_radiance_is_kept() -> None:
    """A white ball under a dome shows the dome's radiance, which a loss of displayed values would miss under noise."""
    white = 4.0

    def noisy(normal: np.ndarray) -> np.ndarray:
        draws = np.random.default_rng(len(normal)).exponential(size=(len(normal), 3))
        return white * (0.5 + 0.5 * draws)

    file = fitted(ball_images(sphere_directions(16), colour=noisy), ball_images(HELD_OUT),
                  replace(SETTINGS, steps=60), white=white)
    held_out = ball_images(HELD_OUT)
    found = np.concatenate([image[truth[..., 3] == 1] for image, truth in
                            zip(looked_at(grid_look(file), held_out, np.arange(8)), held_out.pixels, strict=True)])
    assert (found[:, :3].sum() / found[:, 3].sum()) / 3 == pytest.approx(white, rel=0.02)
