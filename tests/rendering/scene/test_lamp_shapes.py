"""Lamps with a shape of their own as they are rendered: what planning reckons, and one kernel for all sizes."""

import gc

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.geometry.light_axes import rectangle_axes
from dataset_builder.planning.view.emission import direct_irradiance, facing_irradiance
from dataset_builder.rendering.scene.emitters import emitters
from tests.reference_scenes import deviates, diffuse, rectangle, sensor, traced
from tests.small_scenes import light, lit_by

DOWN = {"direction": (0.0, 0.0, -1.0)}


def sent_to_the_origin(lamp):
    """(BATCHES, 3) what a floor at the origin gets, over pi; a thousandth of it is in the frame."""
    floor = rectangle((0, 0, 0), (0, 0, 1), 4, bsdf=diffuse(0.9))
    scene = mi.load_dict({"type": "scene", "floor": floor, **emitters(lit_by(lamp))})
    return traced(scene, sensor((0, -0.9, 0.5), fov=0.05), 64, 3, max_depth=2)["shading"].mean(axis=(1, 2))


@pytest.mark.parametrize(("kind", "more"), [
    ("area", {**DOWN, "size": 0.6, "length": 1.7, "turn": 25.0}), ("disk", {**DOWN, "size": 0.7}),
    ("cylinder", {"direction": (0.0, 1.0, 0.0), "size": 0.3, "length": 1.1}), ("sphere", {"size": 0.3}),
    ("area", {**DOWN, "size": 0.8})])
def test_a_near_lamp_lights_a_plane_exactly_by_its_formula(kind, more):
    """A Z-test that fails one time in a thousand, where the lamp is about as near as it is wide."""
    lamp = light(kind, (3.0, 2.0, 1.0), position=(0.0, 0.0, 0.8), **more)
    found = sent_to_the_origin(lamp)
    sent = facing_irradiance(kind, lamp.size, 0.8, lamp.length) / np.pi * np.array(lamp.radiance)
    assert not deviates(found, sent)
    assert deviates(found, 1.02 * sent), "two hundredths would be seen"


@pytest.mark.parametrize(("beam", "cutoff", "tilt", "share"), [
    (0.0, 40.0, 35.0, 0.5), (10.0, 40.0, 20.0, 2 / 3), (39.99, 40.0, 39.0, 1.0), (100.0, 120.0, 115.0, 0.25),
    (1e-3, 90.0, 45.0, 0.5)])
def test_a_spot_falls_off_from_its_beam_to_its_edge(beam, cutoff, tilt, share):
    aside = (float(np.sin(np.radians(tilt))), 0.0, -float(np.cos(np.radians(tilt))))
    lamp = light("spot", (3.0, 2.0, 1.0), position=(0.0, 0.0, 0.8), direction=aside, beam=beam, cutoff=cutoff)
    sent = direct_irradiance(lamp, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))[0]
    assert sent == pytest.approx(share * np.array(lamp.radiance) / 0.64, rel=1e-4)
    assert sent_to_the_origin(lamp).mean(axis=0) == pytest.approx(sent / np.pi, rel=1e-3)


@pytest.mark.parametrize("turn", [0.0, 40.0])
@pytest.mark.parametrize("direction", [(0.0, 0.0, -1.0), (0.6, 0.0, -0.8)])
def test_a_rectangle_lies_as_its_axes_say(direction, turn):
    """Off its axis, by the sum over small pieces of it."""
    lamp = light("area", (3.0, 2.0, 1.0), position=(-0.3, 0.2, 0.8), direction=direction, size=0.2, length=1.7,
                 turn=turn)
    first, second = rectangle_axes(direction, turn)
    u, v = (((np.arange(400) + 0.5) / 400 - 0.5) * side for side in (0.2, 1.7))
    pieces = np.array(lamp.position) + u[:, None, None] * first + v[None, :, None] * second
    apart = np.linalg.norm(pieces, axis=-1)
    leaving = np.maximum(-(pieces @ np.array(direction)), 0) / apart
    sent = (pieces[..., 2] / apart * leaving / apart**2).mean() * 0.2 * 1.7 / np.pi
    assert not deviates(sent_to_the_origin(lamp), sent * np.array(lamp.radiance))


@pytest.mark.parametrize("kind", ["area", "disk", "cylinder"])
def test_lamps_of_other_sizes_share_a_kernel(kind):
    def render(size):
        gc.collect()
        # In the ball, for the sun makes the scene's bounding sphere a literal of the kernel; `shapes.upload` pads it
        lamp = light(kind, (size, 1.0, 1.0), size=size, length=1 + size, direction=(size, 0.6, -0.8), turn=100 * size,
                     position=(0, 0, 0))
        scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "bsdf": diffuse(0.5)},
                              **emitters(lit_by(lamp))}, parallel=False)
        traced(scene, sensor(), 1, 3)

    render(0.2)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        render(0.3)
        big = [kernel for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000]
    assert len(big) == 1 and big[0]["cache_hit"]


def test_several_suns_shine_and_none_is_lost():
    suns = [light("sun", (value, 0.0, 0.0), direction=(0.0, 0.6, -0.8), size=0.0) for value in (1.0, 2.0, 4.0)]
    floor = rectangle((0, 0, 0), (0, 0, 1), 4, bsdf=diffuse(0.9))
    scene = mi.load_dict({"type": "scene", "floor": floor, **emitters(lit_by(*suns))})
    found = traced(scene, sensor((0, -0.9, 0.5), fov=0.05), 64, 3, max_depth=2)["shading"][..., 0].mean(axis=(1, 2))
    assert not deviates(found, 7 * 0.8 / np.pi)


def test_disks_and_cylinders_stand_only_where_they_shine():
    """Scenes without them hold what they held before there were any."""
    plain = emitters(lit_by(light("point")))
    assert list(plain) == ["dome_0", "sun_0", "area_0", "sphere_0", "point_0", "spot_0"]
    assert set(emitters(lit_by(light("disk"), light("disk"), light("disk")))) - set(plain) == {
        "disk_0", "disk_1", "disk_2", "disk_3"}
