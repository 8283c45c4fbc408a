"""Rooms, lamps and requests at which light paths might fail: nothing crashes, is no number, or is off."""

import dataclasses

import numpy as np
import pytest

from dataset_builder.assets.asset import Material
from dataset_builder.planning.effects.caustic_error import MOST, paths_for
from dataset_builder.rendering.passes import RADIANCE_CHANNELS
from tests.rendering.transport.joined_bench import LAMP, differ, lit, replicas, room, view_of
from tests.small_scenes import ball, box, camera, light, matte, sheet

FAILURES = 1 / 20_000
BALL = room(ball(matte((0.8, 0.5, 0.2)), centre=(-0.3, -0.2, -0.3), radius=0.6))
MIRROR = Material(name="mirror", base_color=(0.9, 0.9, 0.9), roughness=0.0, metallic=1.0)
POINT = light("point", (3.0, 2.5, 2.0), position=(0.4, -0.3, 1.4))
ALONE = camera((0, -4, 0), (0, 0, 0), fov=30)


def shots(soup, *lamps, at=None, **more):
    """Frames by camera paths, and by joined paths with caustics; none may be negative or no number."""
    view = dataclasses.replace(view_of(), camera=at) if at else None
    with lit(soup, *lamps) as opened:
        theirs, ours = (replicas(opened, transport, count=12, caustics=transport == "joined", view=view, **more)
                        for transport in ("camera", "joined"))
    for frames in (theirs, ours):
        assert np.isfinite(frames).all() and frames[..., RADIANCE_CHANNELS["image"]].min() >= 0
    return ours, theirs


OUTSIDE = light("point", (300.0, 300.0, 300.0), position=(0, 0, 9))
FLUSH = light("area", (9.0, 8.0, 7.0), position=(0.4, -0.3, 2.0), size=0.7)
MANY = tuple(light("point", tuple(np.full(3, 0.02 * (1 + k % 7))), position=(x, y, 1.2), weight=1 + k % 7)
             for k, (x, y) in enumerate(np.random.default_rng(1).uniform(-1.5, 1.5, (1000, 2))))


@pytest.mark.parametrize(("soup", "lamps", "more"), [
    (BALL, (FLUSH,), {}), (BALL, (LAMP, OUTSIDE), {}), (BALL, MANY, {}),
    (BALL, (POINT,), {"spp": 1}), (BALL, (POINT,), {"depth": 2}), (BALL, (POINT,), {"depth": 3}),
    (BALL, (POINT,), {"depth": 64}), (room(wall=matte((0, 0, 0))), (POINT,), {}),
    (sheet(matte(), 0, 1), (light("point", (9.0, 9.0, 9.0), position=(1, -2, 1)),), {"at": ALONE}),
    (sheet(matte(), 0, 1), (light("sphere", (9.0, 9.0, 9.0), position=(1, -2, 1)), light("dome")), {"at": ALONE})],
    ids=("flush", "one outside", "a thousand", "spp 1", "depth 2", "depth 3", "depth 64", "black",
         "a sheet alone", "a sheet under the sky"))
def test_expectations_are_those_of_camera_paths(soup, lamps, more):
    ours, theirs = shots(soup, *lamps, **more)
    assert differ(ours, theirs, FAILURES) == []


@pytest.mark.parametrize("position", [(0, 0, 9), (1.0, 0.5, -0.4)], ids=("outside", "in a box"))
def test_nothing_arrives_from_where_nothing_can(position):
    """But what rounding makes of surfaces in one plane: a lamp of 9 in the open gives about 1."""
    ours, _ = shots(BALL, light("point", (9.0, 9.0, 9.0), position=position))
    assert ours.max() < 1e-3 and ours.mean() < 1e-7


def test_a_point_that_touches_a_wall():
    """Half of its light falls on a spot of a thousandth of a millimetre, which only light paths find."""
    ours, theirs = shots(BALL, light("point", (3.0, 2.5, 2.0), position=(0.4, 1.999999, 0.5)))
    image = RADIANCE_CHANNELS["image"]
    assert ours[..., image].mean() > theirs[..., image].mean()


def test_a_room_of_mirrors():
    """Camera paths find next to nothing of it: the two need only be of one magnitude."""
    ours, theirs = shots(room(wall=MIRROR), light("sphere", (20.0, 18.0, 15.0), position=(0.4, -0.3, 1.4), size=0.4),
                         depth=4)
    image = RADIANCE_CHANNELS["image"]
    a, b = (np.median(each[..., image].mean(axis=(1, 2))) for each in (ours, theirs))
    assert 0.5 < a / b < 2


def test_a_lamp_of_a_millimetre_in_a_hall_of_a_hundred_metres():
    hall = box(matte((0.7, 0.6, 0.5)), (-50, -50, 0), (50, 50, 30), 2)
    lamp = light("area", (1e9, 1e9, 1e9), position=(4, 3, 28), size=0.001)
    ours, theirs = shots(hall, lamp, at=camera((0, -40, 5), (0, 0, 5), fov=75))
    assert differ(ours, theirs, FAILURES) == []


def test_one_triangle():
    flat = sheet(matte(), 0, 1)
    kept = ("corners", "normals", "uvs", "material", "instance", "part")
    one = dataclasses.replace(flat, **{name: getattr(flat, name)[:1] for name in kept})
    ours, theirs = shots(one, light("point", (9.0, 9.0, 9.0), position=(1, -2, 1)), at=ALONE)
    assert ours[..., RADIANCE_CHANNELS["image"]].max() > 0
    # Direct light alone, by the same random numbers
    assert differ(ours, theirs, FAILURES) == []


@pytest.mark.parametrize("caustics", [False, True])
def test_light_paths_are_bounded(caustics):
    """800 x 800 pixels at 2^24 spp, and one pixel at one."""
    assert paths_for(800 * 800 * 2**24, caustics) == 4**MOST == 2**18
    assert paths_for(1, caustics) == paths_for(0, caustics) == 4**5
    few = [paths_for(n, caustics) for n in (10**k for k in range(12))]
    assert few == sorted(few)


def test_pixels_that_see_nothing():
    ours, _ = shots(BALL, POINT, at=camera((0, 60, 0), (0, 90, 0)))
    assert not ours.any()
