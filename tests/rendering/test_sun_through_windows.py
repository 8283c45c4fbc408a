"""A sun that is aimed at a window: its patch of light lies where the window's middle is cast, for every wall."""

from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.procedural.rooms import make_room, window_holes
from dataset_builder.errors import PlanError
from dataset_builder.geometry.edges import corner_normals
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.view.daylight import sun
from dataset_builder.rendering import passes
from dataset_builder.rendering.passes import ViewSensor, channels_of
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import merge, soup_of
from dataset_builder.seeding import rng
from dataset_builder.spec.light import SunSpec
from tests.small_scenes import camera, lit_by, matte, render_plan

SIZE, HEIGHT, ELEVATION = 48, 2.3, 50.0


def room_of(windows: int) -> dict[str, Any]:
    return {"width": 5.0, "depth": 4.0, "height": 2.5, "windows": windows, "skirting": 0.0}


@cache
def parts_of(windows: int) -> Any:
    return make_room(**room_of(windows), ceiling=True, seed=1)


@cache
def arrangement_of(windows: int) -> Any:
    meshes = [(part.mesh.positions, part.mesh.faces, 2) for part in parts_of(windows).values()]
    shell = BoxShell(RoomPlan(name="room", seed="1", ceiling=True, **room_of(windows)))
    return SimpleNamespace(shell=shell, centre=np.array([0.0, 0.0, 0.4]), everything=RayScene(meshes))


@pytest.fixture(scope="module")
def arrangement() -> Any:
    return arrangement_of(4)


def aimed(arrangement, through="", azimuth=0.0, elevation=ELEVATION):
    spec = SunSpec.model_validate({"through": through, "azimuth": azimuth, "elevation": elevation})
    return sun(spec, partial(rng, 1, "sun"), "target", arrangement)


@pytest.mark.parametrize(("number", "turned"), [(1, 0), (1, -25), (2, 25), (3, -25), (4, 0)])
def test_the_patch_of_light_lies_where_it_says(number, turned):
    """Turned away from the walls whose windows would let it in as well."""
    light = aimed(arrangement_of(number), f"window_{number}", turned)
    corner, right, up = window_holes(**room_of(number))[number - 1]
    # What passes the outer and the inner edge of the hole, 0.1 m thick, in the middle of it
    middle = corner + (right + up) / 2 + 0.05 * np.cross(right, up) / np.linalg.norm(np.cross(right, up))
    way = np.array(light.direction)
    expected = (middle - way * middle[2] / way[2])[:2]

    floor = merge([soup_of(part.mesh, corner_normals(part.mesh), (matte(),) * len(part.materials), np.eye(4), 2)
                   for part in parts_of(number).values()])
    above = camera(position=(0, 0, HEIGHT), target=(0, 0, 0), fov=100).model_copy(update={"up": (0, 1, 0)})
    with open_scene(body_of(floor), lit_by(light)) as opened:
        found = passes.radiance(ViewSensor(camera=above, render=render_plan(SIZE)), opened, np.arange(SIZE**2),
                                max_depth=2, spp=16, seed=1, wanted=frozenset({"shading"}))
    lit = found.mean[:, channels_of(frozenset({"shading"}))["shading"]].mean(axis=1).reshape(SIZE, SIZE)
    row, column = np.indices((SIZE, SIZE)) + 0.5
    reach = HEIGHT * np.tan(np.radians(50)) / (SIZE / 2)
    at = np.stack([(column - SIZE / 2) * reach, (SIZE / 2 - row) * reach], axis=-1)
    on_floor = (np.abs(at) < (2.4, 1.9)).all(axis=-1)
    patch = (at * (lit * on_floor)[..., None]).sum(axis=(0, 1)) / (lit * on_floor).sum()
    assert lit.max() > 0.2 and np.linalg.norm(patch - expected) < 0.2, (patch, expected)


def test_azimuth_zero_is_the_last_wall_and_counts_to_the_right(arrangement):
    """A sun at azimuth 0 stands over -y, at 90 over +x, so that it comes in through windows 4, 3, 1 and 2."""
    for azimuth, (number, side) in {0: (4, "-y"), 90: (3, "+x"), 180: (1, "+y"), 270: (2, "-x")}.items():
        light = aimed(arrangement, azimuth=azimuth)
        assert arrangement.shell.lets_in(light, np.zeros(3)).why == f"enters through 1 window: window_{number} ({side})"
        assert aimed(arrangement, f"window_{number}").direction == pytest.approx(light.direction, abs=1e-9)


@pytest.mark.parametrize(("asked", "rule"), [
    ({"through": "window_5"}, "expected the name of an opening of room, got 'window_5': there are window_1, window_2"),
    ({"through": "window_1", "azimuth": 120}, "expected a sun that shines on window_1 from outside"),
    ({"through": "window_2", "elevation": 88}, "expected a sun that gets in through window_2, got one at elevation 88"),
])
def test_a_sun_that_cannot_come_in_is_refused_by_name(arrangement, asked, rule):
    with pytest.raises(PlanError) as caught:
        aimed(arrangement, **asked)
    problem, = caught.value.problems
    assert problem.path == "target.sun.through" and problem.rule.startswith(rule) and problem.hint


def test_a_sun_without_a_room_is_not_aimed():
    with pytest.raises(PlanError, match="seen through a field"):
        aimed(None, "window_1")
