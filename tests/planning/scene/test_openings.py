"""Openings of rooms: nothing that leaves a room passes beside them, and they are hardly larger than the holes."""

from collections.abc import Sequence

import numpy as np
import pytest

from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import PortalPlan, RoomPlan
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.scene.shell import Geometry
from dataset_builder.planning.scene.ways_out import ways_out
from dataset_builder.seeding import rng
from tests.planning.scene.houses import box, shell, turned, two_rooms, walled, windowed

HERE = np.array([2.5, 2.0, 0.0])
ROOM = RoomPlan(name="room", seed="1", width=4.4, depth=3.6, height=2.5, ceiling=True, windows=2, skirting=0.08)
WINDOW = np.array([[1.5, 4.1, 0.9], [3.5, 4.1, 2.0]])


def through(portals: Sequence[PortalPlan], origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N,) how many of the portals lines leave through."""
    found = np.zeros(len(origins), int)
    for portal in portals:
        corner, right, up = (np.array(side) for side in (portal.corner, portal.right, portal.up))
        inward = np.cross(right, up)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = (corner - origins) @ inward / (directions @ inward)
        at = origins + step[:, None] * directions - corner
        u, v = at @ right / (right @ right), at @ up / (up @ up)
        found += (step > 0) & (directions @ inward < 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
    return found


def areas(portals: Sequence[PortalPlan]) -> list[float]:
    return [float(np.linalg.norm(portal.right) * np.linalg.norm(portal.up)) for portal in portals]


@pytest.mark.parametrize("windows", range(5))
@pytest.mark.parametrize("ceiling", [True, False])
def test_every_way_out_of_a_room_in_code_is_through_one_opening(windows: int, ceiling: bool) -> None:
    room = ROOM.model_copy(update={"windows": windows, "ceiling": ceiling})
    found = BoxShell(room).openings((), np.zeros(3))
    assert len(found.portals) == windows + (not ceiling)
    made = make_room(width=room.width, depth=room.depth, height=room.height, ceiling=ceiling, windows=windows,
                     skirting=room.skirting, seed=1)
    scene = RayScene([(part.mesh.positions, part.mesh.faces, 2) for part in made.values()])
    draws = rng(3)
    low, high = BoxShell(room).extent
    origins = draws.uniform(low + 0.05, high - 0.05, (100_000, 3))
    directions = draws.normal(size=origins.shape)
    leaving = np.isinf(scene.first_hit(origins, directions)[1])
    assert leaving.any() == bool(found.portals)
    if found.portals:
        assert (through(found.portals, origins[leaving], directions[leaving]) == 1).mean() > 0.9999
        # Walls and frames are before the others
        assert leaving[through(found.portals, origins, directions) > 0].mean() > 0.5


def test_a_room_without_walls_has_no_openings() -> None:
    assert BoxShell(ROOM).openings(("walls",), np.zeros(3)).why == "the walls are removed"
    assert len(BoxShell(ROOM).openings(("ceiling",), np.zeros(3)).portals) == 3
    closed = BoxShell(ROOM.model_copy(update={"windows": 0})).openings((), np.zeros(3))
    assert not closed.portals and closed.why == "there is no opening"


@pytest.mark.parametrize("degrees", [0, 30, 45, 100])
@pytest.mark.parametrize("things", [[], [box((2, 3, 0), (3, 3.4, 1.6), 5), box((0.5, 0.5, 0), (1, 1, 1), 6)]])
def test_a_window_of_a_house_of_triangles_is_found(degrees: float, things: list[Geometry]) -> None:
    turn = turned([(HERE[None], np.zeros((0, 3)), 0)], degrees)[0][0][0]
    space = shell(turned(windowed(), degrees), turned(things, degrees))
    found = space.openings((), turn)
    assert found.why.startswith("1 opening: opening_1 at (") and found.names == ("opening_1",)
    assert len(found.portals) == 1
    corner, right, up = (np.array(side) for side in found.portals[0].model_dump().values())
    back = turned([(np.array([corner, corner + right + up]), np.zeros((0, 3)), 0)], -degrees)[0][0]
    assert np.allclose(np.sort(back, axis=0), WINDOW, atol=0.1)
    # Right and up as they are seen from inside
    assert np.cross(right, up) @ (turn + np.array([0, 0, 1.0]) - corner) > 0
    lines = ways_out(space.space.everything, turn, None, paths=20_000, seed=9).leaving
    assert len(lines.origins) > 500
    assert (through(found.portals, *lines) == 1).mean() > 0.998


def test_what_light_gets_in_through_in_another_room_is_found_too() -> None:
    house = [part for part in two_rooms() if part[0].min(axis=0)[0] < 7.9]
    house += [box((8, 0, 0), (8.1, 1, 2.5)), box((8, 3, 0), (8.1, 4, 2.5)), box((8, 1, 0), (8.1, 3, 0.9)),
              box((8, 1, 2), (8.1, 3, 2.5))]
    found = shell(house).openings((), np.array([2.0, 2.0, 0.0])).portals
    assert len(found) == 1 and found[0].corner[0] == pytest.approx(8.1, abs=0.06)
    assert 2.2 <= areas(found)[0] < 3.2


def test_an_open_top_is_an_opening() -> None:
    found = shell(walled(5, 4, 2.5, roof=False)).openings((), HERE).portals
    assert len(found) == 1 and 20 <= areas(found)[0] < 21
    assert np.cross(found[0].right, found[0].up)[2] < 0


def test_where_there_is_no_hole_a_reason_is_given() -> None:
    closed = shell(walled(5, 4, 2.5)).openings((), HERE)
    assert not closed.portals and closed.why == "no path leads out"
    outdoors = shell([box((-5, -5, -0.1), (5, 5, 0))]).openings((), np.array([1.0, 0, 0]))
    assert not outdoors.portals and outdoors.why == "paths lead out all round"
    removed = shell(walled(5, 4, 2.5)).openings(("ceiling",), HERE)
    assert not removed.portals and removed.why == "the ceiling is removed"


def test_gaps_of_a_paling_are_one_opening_on_each_side() -> None:
    """Twelve pales of 15 cm along each side of a roofed square."""
    house = [part for part in walled(4, 4, 2.5) if np.ptp(part[0], axis=0)[2] < 0.5]
    for k in range(12):
        low, high = k / 3, k / 3 + 0.15
        house += [box((low, -0.1, 0), (high, 0, 2.5)), box((low, 4, 0), (high, 4.1, 2.5)),
                  box((-0.1, low, 0), (0, high, 2.5)), box((4, low, 0), (4.1, high, 2.5))]
    found = shell(house).openings((), np.array([2.0, 2.0, 0.0]))
    assert found.why.startswith("4 openings: ") and len(found.names) == 4
    assert all(9 < area < 14 for area in areas(found.portals))


def test_a_dozen_windows_are_too_many() -> None:
    house = [part for part in walled(12, 4, 2.5) if part[0].max(axis=0)[1] > 0.05 and part[0].min(axis=0)[1] < 3.9]
    for y in (-0.1, 4.0):
        house += [box((0, y, 0), (12, y + 0.1, 0.9)), box((0, y, 1.8), (12, y + 0.1, 2.5)),
                  *(box((2 * k - 0.6, y, 0.9), (2 * k + 0.6, y + 0.1, 1.8)) for k in range(7))]
    found = shell(house).openings((), np.array([6.0, 2.0, 0.0]))
    assert not found.portals and "paths out of the scene pass through none of 8 openings found" in found.why


def test_the_search_is_repeatable() -> None:
    first, second = (shell(windowed()).openings((), HERE) for _ in range(2))
    assert first == second
