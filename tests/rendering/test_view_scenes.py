"""Projection against the camera that renders, and windows that hold what they must."""

import mitsuba as mi
import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.rendering import passes
from dataset_builder.rendering.scene.open_scene import body_of, open_scene, sensor_of
from dataset_builder.rendering.view_scenes import covered_window
from tests.small_scenes import ball, camera, matte, render_plan


def test_projection_is_mitsubas():
    plan, rng = camera((1.0, -3.0, 2.0), (0.2, 0.1, 0.3), 50.0), np.random.default_rng(2)
    film = rng.uniform(0, 1, (20, 2))
    ray, _ = sensor_of(plan, 64, 48).sample_ray(0, 0.5, mi.Point2f(film.T), mi.Point2f(0.5))
    points = (np.array(ray.o) + 2.5 * np.array(ray.d)).T
    column, row, distance = Pinhole.of(plan, 64, 48).project(points).T
    assert np.allclose(column, 64 * film[:, 0], atol=1e-3)
    assert np.allclose(row, 48 * film[:, 1], atol=1e-3)
    assert np.all(distance > 0)


def test_window_holds_every_covered_pixel_and_little_else():
    size, soup = 40, ball(matte(), (0.3, 0.2, 0.1), 0.5)
    view = passes.ViewSensor(camera=camera(), render=render_plan(size))
    frame = np.arange(size * size)
    with open_scene(body_of(soup), None) as opened:
        found = passes.first_hit(view, opened, frame, 16, view.render.batches, 3)
    covered = frame[found.mean[:, 0] > 0]
    window = covered_window(Pinhole.of(view.camera, size, size), soup.corners.reshape(-1, 3))
    assert len(covered) > 0 and set(covered) <= set(window)
    assert len(window) < 2.5 * len(covered)


def test_point_behind_the_camera_asks_for_the_whole_frame():
    points = np.array([[0.0, 0, 0], [0, -9, 0]])
    assert len(covered_window(Pinhole.of(camera(), 8, 6), points)) == 48
