"""The frame of a view: what is moved and scaled sends the same light."""

from typing import get_args

import numpy as np
import pytest

from dataset_builder.label.scene_plan import FogPlan, PortalPlan
from dataset_builder.light_kinds import LampName
from dataset_builder.planning.view.emission import direct_irradiance
from dataset_builder.rendering.scene.local_frame import LocalFrame
from tests.small_scenes import ball, camera, light, lit_by, matte

CORNERS = ball(matte(), centre=(1e4, -3.0, 2.0), radius=1e-3).corners


def test_an_object_anywhere_of_any_size_is_about_one_unit_at_the_origin():
    for scale in (1e-3, 1.0, 1e3):
        points = LocalFrame.of(scale * CORNERS).points(scale * CORNERS)
        assert np.abs(points.mean(axis=(0, 1))).max() < 0.1 and 0.4 < np.linalg.norm(points, axis=-1).max() < 2


def test_the_unit_is_a_power_of_two_and_a_point_has_a_frame():
    assert np.log2(LocalFrame.of(CORNERS).unit) % 1 == 0
    assert LocalFrame.of(np.ones((1, 3, 3))).unit == 1.0


@pytest.mark.parametrize("kind", [*get_args(LampName), "sun"])
def test_lights_send_the_same_irradiance(kind):
    frame = LocalFrame(origin=(5.0, -2.0, 1.0), unit=0.25)
    lamp = light(kind, radiance=(3.0, 2.0, 1.0), position=(5.3, -2.0, 4.0), size=0.2)
    moved = frame.illumination(lit_by(lamp)).lights[0]
    point, up = np.array([[5.0, -2.0, 1.0]]), np.array([[0.0, 0.0, 1.0]])
    assert direct_irradiance(moved, frame.points(point), up) == pytest.approx(direct_irradiance(lamp, point, up))


def test_cameras_look_along_the_same_line_and_fog_takes_the_same_share():
    frame, seen = LocalFrame(origin=(1.0, 2.0, 3.0), unit=4.0), camera()
    moved = frame.camera(seen)
    way = np.array(seen.target) - np.array(seen.position)
    assert (np.array(moved.target) - np.array(moved.position)) * 4 == pytest.approx(way)
    assert moved.fov == seen.fov and moved.up == seen.up
    assert frame.fog(FogPlan(extinction=0.1)).extinction * np.linalg.norm(way) / 4 == pytest.approx(
        0.1 * np.linalg.norm(way))


def test_portals_take_the_same_part_of_the_sky():
    frame, portal = LocalFrame(origin=(1.0, 2.0, 3.0), unit=0.5), PortalPlan(corner=(1, 4, 3), right=(2, 0, 0),
                                                                            up=(0, 0, 1))
    moved = frame.portal(portal)
    assert moved == PortalPlan(corner=(0, 4, 0), right=(4, 0, 0), up=(0, 0, 2))
