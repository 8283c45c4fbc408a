"""Solids with round or drawn-out sides: lofts through stations, turned profiles, bars between two points."""

import numpy as np

from dataset_builder.assets.procedural.boxes import split_quads, with_uvs
from dataset_builder.geometry.mesh import TriangleMesh

FINE, COARSE = 48, 32
"""Sides of a circle: for what shapes an outline, and for legs and bars."""


def circle(sides: int) -> np.ndarray:
    """(sides, 2) points of the unit circle, counter-clockwise, the first at the back (+Y), where a seam shows least."""
    angles = np.pi / 2 + 2 * np.pi * np.arange(sides) / sides
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def chamfered_square(bevel: float) -> np.ndarray:
    """(8, 2) outline of the square [-1, 1]^2 with corners cut by `bevel` (of the half side), counter-clockwise."""
    cut = 1 - min(bevel, 0.6)
    return np.array([(cut, 1), (-cut, 1), (-1, cut), (-1, -cut), (-cut, -1), (cut, -1), (1, -cut), (1, cut)],
                    dtype=float)


def loft(section: np.ndarray, centres: np.ndarray, scales: np.ndarray) -> TriangleMesh:
    """Closed solid through `section` (N, 2) scaled by `scales` (K, 2) and moved to `centres` (K, 3), z not falling.

    Sections stay level; both ends are capped. Coordinates in metres: u around, v along, planar on the caps.
    """
    sides, count = len(section), len(centres)
    rings = np.zeros((count, sides, 3))
    rings[..., :2] = section[None] * scales[:, None]
    rings += centres[:, None]
    positions = np.concatenate([rings.reshape(-1, 3), centres[[0, -1]]])
    around = _grid(count, sides, close_rows=False)
    loop, following = np.arange(sides), np.roll(np.arange(sides), -1)
    low = np.stack([following, loop, np.full(sides, count * sides)], axis=-1)
    last = (count - 1) * sides
    high = np.stack([loop + last, following + last, np.full(sides, count * sides + 1)], axis=-1)
    faces = np.concatenate([split_quads(around), low, high])
    tube = _tube_uvs(rings, close_rows=False)
    below, above = positions[low][..., :2] * (-1, 1), positions[high][..., :2]
    return with_uvs(positions, faces, np.concatenate([tube, below, above]))


def _grid(rows: int, sides: int, *, close_rows: bool) -> np.ndarray:
    """(Q, 4) quadrilaterals of rings around z, outward where the ring turns counter-clockwise and rows go up."""
    index = np.arange(rows * sides).reshape(rows, sides)
    index = np.concatenate([index, index[:, :1]], axis=1)
    index = np.concatenate([index, index[:1]]) if close_rows else index
    return np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)


def _tube_uvs(rings: np.ndarray, *, close_rows: bool) -> np.ndarray:
    """(2Q, 3, 2) coordinates of the quadrilaterals of `_grid`: mean arc length around and along, so that none jumps."""
    rows = len(rings)
    girth = np.linalg.norm(rings - np.roll(rings, -1, axis=1), axis=-1).mean(axis=0)
    u = np.concatenate([[0.0], np.cumsum(girth)])
    steps = np.linalg.norm(np.roll(rings, -1, axis=0) - rings, axis=-1).mean(axis=1)
    v = np.concatenate([[0.0], np.cumsum(steps)])[: rows + close_rows]
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 2)
    return quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 2)


def turned(profile: np.ndarray, *, sides: int = FINE) -> TriangleMesh:
    """Solid of revolution about z of `profile` (K, 2): radii > 0 and heights, from the bottom's rim to the top's.

    Both ends are closed by flat caps; the profile may rise and fall, so a vase with an inside is one profile.
    """
    centres = np.zeros((len(profile), 3))
    centres[:, 2] = profile[:, 1]
    return loft(circle(sides), centres, np.repeat(profile[:, :1], 2, axis=1))


def hoop(profile: np.ndarray, *, sides: int = FINE) -> TriangleMesh:
    """Ring about z of the closed `profile` (K, 2) of radii and heights, counter-clockwise (outer side first, going
    up).
    """
    unit = circle(sides)
    heights = np.broadcast_to(profile[:, None, 1:], (len(profile), sides, 1))
    rings = np.concatenate([profile[:, None, :1] * unit[None], heights], axis=-1)
    faces = split_quads(_grid(len(profile), sides, close_rows=True))
    return with_uvs(rings.reshape(-1, 3), faces, _tube_uvs(rings, close_rows=True))


def disc(radius: float, height: float, *, bevel: float, sides: int = FINE) -> TriangleMesh:
    """Cylinder of `radius` on z in [0, height] with chamfered rims."""
    cut = min(bevel, height / 3, radius / 3)
    return turned(np.array([(radius - cut, 0), (radius, cut), (radius, height - cut), (radius - cut, height)]),
                  sides=sides)


def post(section: np.ndarray, path: np.ndarray, radii: np.ndarray, *, bevel: float) -> TriangleMesh:
    """Leg or post along `path` (K, 3), rising, with half widths `radii` (K,) and chamfered ends."""
    cut = min(bevel, float(np.diff(path[:, 2]).min()) / 3, float(radii.min()) / 2)
    low = path[0] + (path[1] - path[0]) * cut / (path[1, 2] - path[0, 2])
    high = path[-1] - (path[-1] - path[-2]) * cut / (path[-1, 2] - path[-2, 2])
    centres = np.concatenate([path[:1], low[None], path[1:-1], high[None], path[-1:]])
    widths = np.concatenate([[radii[0] - cut, radii[0]], radii[1:-1], [radii[-1], radii[-1] - cut]])
    return loft(section, centres, np.repeat(widths[:, None], 2, axis=1))


def bar(start: np.ndarray, end: np.ndarray, radius: float, *, bevel: float = 0.001,
        sides: int = COARSE) -> TriangleMesh:
    """Round bar of `radius` from `start` to `end` (3,), in any direction, with square chamfered ends."""
    axis = np.asarray(end, dtype=float) - np.asarray(start, dtype=float)
    length = float(np.linalg.norm(axis))
    mesh = disc(radius, length, bevel=bevel, sides=sides)
    third = axis / length
    first = np.cross(np.eye(3)[int(np.abs(third).argmin())], third)
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(third, first), third])
    return with_uvs(mesh.positions @ frame + np.asarray(start), mesh.faces, mesh.uvs)
