"""Small houses made in code: floors, walls and ceilings as boxes, and things in them."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.scene.mesh_shell import MeshShell, shell_of
from dataset_builder.planning.scene.shell import Geometry

FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])
Corner = tuple[float, float, float]
ROOM = RoomPlan(name="house", seed="0", width=0, depth=0, height=0, ceiling=True, windows=0, skirting=0, kind="file")


def box(low: Corner, high: Corner, instance: int = 2) -> Geometry:
    """A closed box, its faces outward."""
    positions = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])],
                         dtype=float)
    outward = FACES[:, ::-1] if _volume(positions) < 0 else FACES
    return positions, outward, instance


def _volume(positions: np.ndarray) -> float:
    a, b, c = positions[FACES].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))


def shell(building: Sequence[Geometry], contents: Sequence[Geometry] = ()) -> MeshShell:
    """The space of a house."""
    found = shell_of(ROOM, building, contents)
    assert isinstance(found, MeshShell)
    return found


def walled(x: float, y: float, height: float, *, roof: bool = True, at: Corner = (0, 0, 0)) -> list[Geometry]:
    """A room of x by y metres with its corner at `at`: floor and walls 0.1 m thick, and a roof."""
    a, b, c = at
    parts = [((a, b, c - 0.1), (a + x, b + y, c)), ((a - 0.1, b, c), (a, b + y, c + height)),
             ((a + x, b, c), (a + x + 0.1, b + y, c + height)), ((a, b - 0.1, c), (a + x, b, c + height)),
             ((a, b + y, c), (a + x, b + y + 0.1, c + height))]
    parts += [((a - 0.1, b - 0.1, c + height), (a + x + 0.1, b + y + 0.1, c + height + 0.1))] if roof else []
    return [box(*part) for part in parts]


def l_shape(height: float = 2.6) -> list[Geometry]:
    """[0, 6] x [0, 3] and [0, 2] x [3, 7], with walls and a roof: 26 square metres."""
    parts = [((0, 0, -.1), (6, 3, 0)), ((0, 3, -.1), (2, 7, 0)), ((0, 0, height), (6, 3, height + .1)),
             ((0, 3, height), (2, 7, height + .1)), ((-.1, 0, 0), (0, 7, height)), ((0, -.1, 0), (6, 0, height)),
             ((6, 0, 0), (6.1, 3, height)), ((2, 3, 0), (6, 3.1, height)), ((2, 3.1, 0), (2.1, 7, height)),
             ((0, 7, 0), (2, 7.1, height))]
    return [box(*part) for part in parts]


def two_rooms() -> list[Geometry]:
    """[0, 8] x [0, 4], with an inner wall at x = 4 that has a door of 0.7 m between y = 1 and 1.7."""
    inner = [((3.95, 0, 0), (4.05, 1, 2.5)), ((3.95, 1.7, 0), (4.05, 4, 2.5)), ((3.95, 1, 2.1), (4.05, 1.7, 2.5))]
    return walled(8, 4, 2.5) + [box(*part) for part in inner]  # type: ignore[arg-type]


def two_storeys() -> list[Geometry]:
    """Two rooms of 5 by 4 metres above each other and a roof, floors at 0 and 2.7."""
    return walled(5, 4, 2.6, roof=False) + walled(5, 4, 2.4, at=(0, 0, 2.7))


def windowed() -> list[Geometry]:
    """A room whose wall at y = 4 has a hole of 2 x 1.1 metres."""
    parts = [part for part in walled(5, 4, 2.5) if part[0].min(axis=0)[1] < 3.9]
    return [*parts, box((0, 4, 0), (1.5, 4.1, 2.5)), box((3.5, 4, 0), (5, 4.1, 2.5)),
            box((1.5, 4, 0), (3.5, 4.1, 0.9)), box((1.5, 4, 2), (3.5, 4.1, 2.5))]


def turned(house: Sequence[Geometry], degrees: float) -> list[Geometry]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return [(positions @ np.array([(c, s, 0), (-s, c, 0), (0, 0, 1)]), faces, number)
            for positions, faces, number in house]
