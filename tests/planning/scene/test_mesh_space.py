"""Cameras, lamps and light from outside in a scene given as triangles; a box of triangles answers as a box does."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.planning.effects.reach import reach
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.scene.mesh_shell import MeshShell, shell_of
from dataset_builder.planning.scene.shell import Geometry
from dataset_builder.planning.scene.ways_out import BOUNCES, PATHS
from dataset_builder.planning.view.cameras import place_camera
from dataset_builder.seeding import rng
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.render import ImageSpec
from tests.planning.scene.houses import ROOM, box, l_shape, shell, two_rooms, two_storeys, walled
from tests.plans import light_plan

CENTRED = ROOM.model_copy(update={"width": 5.0, "depth": 4.0, "height": 2.5, "kind": "procedural"})
STANDS = ((-0.3, -0.3, 0.0), (0.3, 0.3, 0.9))


def both() -> tuple[MeshShell, BoxShell]:
    """A room of triangles and the same as a box."""
    return shell(walled(5, 4, 2.5, at=(-2.5, -2, 0))), BoxShell(CENTRED)


def arrangement(building: list[Geometry], at: tuple[float, float, float], contents: tuple[Geometry, ...] = ()) \
        -> Arrangement:
    """A block of 0.6 x 0.6 x 0.9 m that stands at a place in a house."""
    plan = ObjectPlan(name="block", kind="procedural", source="block", source_sha256="", category="block",
                      licence="CC0-1.0", seed="0", params=(), scale=1.0, up="z")
    own = box(*STANDS, 1)
    return Arrangement(room=ROOM, target=PlacedObject(object=plan, instance=1, position=at, yaw=0.0), furniture=(),
                       geometry=((own[0] + at, own[1], 1), *building, *contents), shell=shell(building, contents))


def cameras(stage: Arrangement, count: int, **spec: object) -> np.ndarray:
    """(count, 3) positions of cameras around all of the target."""
    asked = CameraSpec.model_validate({"coverage": (0.05, 0.3), "fov": 60, "azimuth": {"uniform": [-180, 180]}} | spec)
    return np.array([place_camera(stage, asked, ImageSpec(), rng(3, k), "view").camera.position for k in range(count)])


@pytest.mark.parametrize("margin", [0.0, 0.15])
def test_a_box_of_triangles_is_as_deep_as_a_box(margin: float) -> None:
    triangles, formulas = both()
    draws = rng(0)
    for _ in range(60):
        centre, direction = draws.uniform([-1.5, -1, 0.4], [1.5, 1, 2]), draws.normal(size=3)
        direction /= np.linalg.norm(direction)
        assert triangles.depth(centre, direction, margin) == pytest.approx(formulas.depth(centre, direction, margin),
                                                                           abs=1e-3)


@pytest.mark.parametrize("margin", [0.0, 0.02, 0.3])
def test_a_box_of_triangles_holds_the_points_of_a_box(margin: float) -> None:
    """Away from its walls; half of the points are outside."""
    triangles, formulas = both()
    points = rng(1).uniform([-3.2, -2.6, -0.5], [3.2, 2.6, 3.2], (2000, 3))
    centre = np.array([0.3, 0.2, 0.5])
    low, high = formulas.extent
    near = np.abs(np.concatenate([points - low - margin, points - high + margin], axis=1)).min(axis=1) < 1e-3
    expected = np.array([formulas.inside(point, margin, centre) for point in points])
    assert 0.2 < expected.mean() < 0.8
    assert np.array_equal(triangles.space.inside(points, margin, centre)[~near], expected[~near])


def test_a_camera_looks_through_a_door_and_not_through_walls() -> None:
    space, centre = shell(two_rooms()), np.array([4.8, 1.35, 0.5])
    for point, good in (((2.0, 1.35, 1.0), True), ((3.0, 3.5, 1.0), False), ((6.5, 3.5, 1.0), True),
                        ((4.8, 1.35, 3.5), False), ((4.8, -1.0, 1.0), False)):
        assert space.inside(np.array(point), 0.1, centre) == good
    assert space.depth(centre, np.array([-1.0, 0, 0]), 0.15) == pytest.approx(4.8 - 0.15, abs=1e-3)
    assert space.depth(np.array([4.8, 3.0, 0.5]), np.array([-1.0, 0, 0]), 0.15) == pytest.approx(0.6, abs=1e-3)


def test_a_camera_does_not_look_in_from_the_street_but_out_of_a_window_it_may() -> None:
    """The wall at y = 4 is open between 0.9 and 2 m."""
    house = [part for part in walled(5, 4, 2.5) if part[0].min(axis=0)[1] < 3.9]
    house += [box((0, 4, 0), (5, 4.1, 0.9)), box((0, 4, 2), (5, 4.1, 2.5)), box((-9, -9, -0.3), (14, 20, -0.2))]
    space, within, without = shell(house), np.array([2.5, 3.0, 1.2]), np.array([2.5, 7.0, 1.2])
    street, room = np.array([2.5, 5.5, 1.3]), np.array([2.5, 2.0, 1.3])
    assert space.inside(room, 0.1, within) and not space.inside(street, 0.1, within)
    assert space.inside(street, 0.1, without) and space.inside(room, 0.1, without)
    assert space.depth(within, np.array([0.0, 1.0, 0.0]), 0.1) < 1.2
    assert space.depth(without, np.array([0.0, 1.0, 0.0]), 0.1) > 10


@pytest.mark.parametrize(("house", "at"), [(l_shape, (1.0, 5.0, 0.0)), (two_storeys, (2.0, 2.0, 2.7))])
def test_cameras_stay_in_the_room_of_their_target(house: Callable[[], list[Geometry]],
                                                  at: tuple[float, float, float]) -> None:
    x, y, z = cameras(arrangement(house(), at), 8).T
    assert (z > at[2] + 0.1).all() and (z < at[2] + 2.6).all()
    if house is l_shape:
        assert (((x < 2) & (y < 7)) | (y < 3)).all() and min(x.min(), y.min()) > 0
    else:
        assert min(x.min(), y.min()) > 0 and x.max() < 5 and y.max() < 4


def test_cameras_outdoors_are_above_ground_and_near() -> None:
    stage = arrangement([box((-5, -5, -0.1), (5, 5, 0))], (1.0, 0.0, 0.0))
    x, y, z = cameras(stage, 8, elevation={"uniform": [-20, 60]}).T
    assert (z > 0).all() and np.hypot(x - 1, y).max() < 12
    for point, good in (((1, 3, -0.05), False), ((1, 3, -3), False), ((1, 3, 8), True), ((1, 60, 8), False)):
        assert stage.shell.inside(np.array(point, float), 0.0, stage.centre) == good


def test_a_camera_that_finds_no_place_speaks_of_the_scene() -> None:
    stage = arrangement(walled(1.4, 1.4, 1.6), (0.7, 0.7, 0.0))
    with pytest.raises(PlanError, match="beyond walls, floors or the edge of the scene") as caught:
        cameras(stage, 1, attempts=5, fov=30)
    assert "room larger" not in str(caught.value) and "0.00 x" not in str(caught.value)


def test_nothing_gets_into_a_closed_house_and_a_window_lets_in_what_it_faces() -> None:
    near = (2.5, 2.0, 0.0)
    closed, dome, sun = shell(walled(5, 4, 2.5)), light_plan("dome"), light_plan("sun")
    why = f"0 of {PATHS} paths from beside the object, with at most {BOUNCES} bounces, lead out"
    found = reach(dome, closed, (), near)
    assert not found.kept and found.why == why
    assert reach(dome, closed, ("ceiling",), near).kept
    assert reach(light_plan("point"), closed, (), near).why == "stands in the scene"
    windowed = [part for part in walled(5, 4, 2.5) if part[0].min(axis=0)[1] < 3.9]
    windowed += [box((0, 4, 0), (5, 4.1, 0.9)), box((0, 4, 2), (5, 4.1, 2.5))]
    house = shell(windowed)
    assert reach(dome, house, (), near).kept
    into, onto = (0.0, -0.8, -0.6), (0.0, 0.8, -0.6)
    seen = {way: reach(sun.model_copy(update={"direction": way}), house, (), near) for way in (into, onto)}
    assert seen[into].kept and not seen[onto].kept and seen[onto].why.endswith("bounces, see it")


def test_no_light_enters_where_a_scene_has_no_part_to_remove() -> None:
    near, dome = (2.5, 2.0, 0.0), light_plan("dome")
    closed = replace(shell(walled(5, 4, 2.5)), parts=("walls",))
    found, beside = (reach(dome, closed, opened, near) for opened in (("ceiling",), ("ceiling", "walls", "floor")))
    assert not found.kept and found.why.endswith("bounces, lead out (the scene has no ceiling to remove)")
    assert beside.kept
    assert beside.why == "enters where the walls are removed (the scene has no ceiling and no floor to remove)"
    assert reach(light_plan("point"), closed, ("ceiling",), near).why == "stands in the scene"


def test_light_comes_round_corners() -> None:
    """Behind an inner wall no straight way leads out, but light that bounces comes through the door."""
    house = [part for part in two_rooms() if part[0].min(axis=0)[0] < 7.9]
    dark = [*house, box((8, 0, 0), (8.1, 4, 1.0)), box((8, 0, 2.0), (8.1, 4, 2.5))]
    found = reach(light_plan("dome"), shell(dark), (), (0.6, 3.5, 0.0))
    open_air = reach(light_plan("dome"), shell([box((-5, -5, -0.1), (5, 5, 0))]), (), (0.0, 0.0, 0.0))
    assert found.kept and 0 < int(found.why.split()[0]) < PATHS / 4
    # All leave: what goes down meets the ground and bounces up
    assert open_air.why.startswith(f"{PATHS} of {PATHS}")


def test_a_procedural_room_stays_a_box(room_of: Callable[..., RoomPlan]) -> None:
    assert shell_of(room_of(), walled(5, 4, 2.5), ()) == BoxShell(room_of())


def test_answers_do_not_depend_on_what_was_asked_before() -> None:
    points = np.array(list(product((0.5, 2.5, 4.5), (0.5, 3.5), (0.3, 2.0))))
    first = shell(walled(5, 4.01, 2.5))
    before = first.space.inside(points, 0.1, points[0])
    other = shell(walled(5, 4.01, 2.5))
    assert other.said == first.said and np.array_equal(other.space.inside(points, 0.1, points[0]), before)


def test_lamps_have_room_about_a_tiny_scene_without_a_building() -> None:
    """They stand as far from a thing of 2 cm as from a chair, and not without end."""
    tiny = shell([], [box((0, 0, 0), (0.02, 0.02, 0.02), 3)])
    above = np.array([0.01, 0.01, 0.02])
    assert tiny.inside(above + np.array([0, 0, 5]), 0.1, above)
    assert not tiny.inside(above + np.array([0, 0, 50]), 0.1, above)
