"""Projection against the camera that renders, and windows that hold what they must."""

from pathlib import Path
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.scene_plan import FogPlan
from dataset_builder.rendering import passes
from dataset_builder.rendering.scene.local_frame import LocalFrame
from dataset_builder.rendering.scene.open_scene import body_of, open_scene, sensor_of
from dataset_builder.rendering.view_scenes import ViewScenes, bounds, covered_window
from tests.plans import example_plan
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


def test_bounds_hold_all_points_of_any_shape():
    low, high = bounds([np.array([[[0, 1, 2], [3, -1, 0]]]), np.zeros((0, 3)), np.array([9.0, 0, 0])])
    assert low.tolist() == [0, -1, 0] and high.tolist() == [9, 1, 2]


def test_fog_fills_a_room_of_ours_and_what_a_file_holds_with_the_camera():
    """In the target's frame: a unit of 2 m about (1, 0, 0), a camera 7 m up, and 3 m of surroundings along x."""
    frame = LocalFrame(origin=(1.0, 0.0, 0.0), unit=2.0)
    whole = example_plan()
    effects = whole.effects.model_copy(update={"features": ("fog",)})
    boxes = {"procedural": ((-1.5, -0.875, 0), (0.5, 0.875, 1.3)), "file": ((-1, -1, -1), (1.5, 1, 3.5))}
    for kind, (low, high) in boxes.items():
        plan = whole.model_copy(update={
            "room": whole.room.model_copy(update={"kind": kind}), "effects": effects,
            "camera": whole.camera.model_copy(update={"position": (1.0, 0.0, 7.0)}),
            "fog": FogPlan(extinction=0.1, albedo=0.9)})
        scenes = ViewScenes(plan=plan, mesh_root=Path())
        own = np.array([[[-1.0, -1, -1], [1, 1, 1], [0, 0, 0]]])
        around = SimpleNamespace(corners=np.array([[[0, 0, 0], [1.5, 0, 0], [0, 0, 0.1]]]))
        scenes.__dict__ |= {"local_frame": frame, "clean_object": SimpleNamespace(corners=own), "_room": around}
        fog = scenes._fog
        assert np.ravel(fog.low) == pytest.approx(low, abs=1e-6) and np.ravel(fog.high) == pytest.approx(high, abs=1e-6)
