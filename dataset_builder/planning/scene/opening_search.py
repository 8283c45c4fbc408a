"""Where light gets into a scene given as triangles: rectangles in planes of what is built, found from ways out.

Lines that leave the scene are dense where they pass through a hole, and spread behind it. So in every plane that walls,
floors or ceilings lie in, the places where lines cross it are gathered into rectangles; the rectangle with the most
lines for its area is an opening, its lines are taken away, and the next one is looked for.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dataset_builder.label.scene_plan import PortalPlan, Vector
from dataset_builder.planning.scene.shell import Geometry, Openings
from dataset_builder.planning.scene.storeys import corners_of
from dataset_builder.planning.scene.ways_out import Lines

MOST = 8
"""Rectangles that are looked for."""
MISSED = 0.01
"""Share of other lines that may pass through none of them."""
FEWEST, LEAST = 12, 0.01
"""Lines through a rectangle, and their share of all, that it is an opening from."""
CELL, MARGIN, GROWN = 0.1, 0.02, 0.3
"""Metres: of the grid that crossings are gathered on; added about a rectangle; within which further lines make one
larger."""
UNSEEN = 10.0
"""Lines that would have to pass at the edge of a rectangle where none does."""
SMALLEST = 0.1
"""Square metres added to areas, so that few lines close together are no opening."""
FLAT, PLANES, BIN = 0.996, 24, 0.05
"""Cosine up to which a face counts as square to an axis; planes of each axis, the largest; metres between them."""
AXES = ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1))
"""Axis and sign of the outward normals that openings have: light from below is none."""


@dataclass(frozen=True)
class _Rectangle:
    """In a plane square to an axis of the building."""

    axis: int
    sign: int
    offset: float
    """Of the plane, along the axis."""
    low: np.ndarray
    """(2,) along the two other axes."""
    high: np.ndarray

    def grown(self, by: float) -> "_Rectangle":
        """The same with a rim."""
        return _Rectangle(self.axis, self.sign, self.offset, self.low - by, self.high + by)

    def holds(self, lines: Lines) -> np.ndarray:
        """(N,) bool: which lines leave through it."""
        points, outward = _crossings(lines, self.axis, self.sign, self.offset)
        return outward & ((points >= self.low) & (points <= self.high)).all(axis=1)


def openings_of(building: Sequence[Geometry], lines: Lines, others: Lines) -> Openings:
    """Rectangles that cover where `lines` leave a scene, held against `others`, lines that they do not know.

    None, with the reason, where MOST rectangles are too few.
    """
    if not len(lines.origins):
        return Openings(portals=(), why="no path leads out")
    if not building:
        return Openings(portals=(), why="nothing is built about the object")
    turn = _turned(building)
    within, beyond = (Lines(each.origins @ turn.T, each.directions @ turn.T) for each in (lines, others))
    found = _search(np.concatenate([corners.reshape(-1, 3, 3) for corners in corners_of(building)]) @ turn.T, within)
    if not found:
        return Openings(portals=(), why="paths lead out all round")
    missed = ~_any(found, beyond)
    said = f"{len(found)} opening{'' if len(found) == 1 else 's'}"
    if missed.mean() > MISSED:
        return Openings(portals=(), why=f"{missed.sum()} of {len(missed)} paths out of the scene pass through none of "
                        f"{said} found")
    portals = tuple(_portal(rectangle, turn) for rectangle in found)
    names = tuple(f"opening_{k}" for k in range(1, len(portals) + 1))
    placed = ", ".join(f"{name} at {_middle(portal)}" for name, portal in zip(names, portals, strict=True))
    return Openings(portals=portals, why=f"{said}: {placed}", names=names)


def _middle(portal: PortalPlan) -> str:
    """Where the middle of a rectangle is, in words."""
    at = np.asarray(portal.corner) + (np.asarray(portal.right) + np.asarray(portal.up)) / 2
    return f"({', '.join(f'{value:.1f}' for value in at)})"


def _search(corners: np.ndarray, lines: Lines) -> list[_Rectangle]:
    """Openings, those with the most lines for their area first. corners: (F, 3, 3) of what is built."""
    planes = [(axis, sign, offset) for axis, sign in AXES for offset in _offsets(corners, axis)]
    bounds = corners.min(axis=(0, 1)) - CELL, corners.max(axis=(0, 1)) + CELL
    found, left = list[_Rectangle](), np.arange(len(lines.origins))
    fewest = max(FEWEST, LEAST * len(left))
    while len(found) < MOST and len(left) >= fewest:
        own = Lines(lines.origins[left], lines.directions[left])
        best = max((each for plane in planes for each in _gathered(own, *plane, bounds, fewest)),
                   key=lambda each: each[1], default=None)
        if best is None:
            break
        found.append(best[0].grown(CELL / 4))
        left = left[~found[-1].holds(own)]
    for number, rectangle in enumerate(found):
        others = found[:number] + found[number + 1:]
        near = rectangle.grown(GROWN).holds(lines) & ~_any(others, lines)
        points, _ = _crossings(lines, rectangle.axis, rectangle.sign, rectangle.offset)
        if near.any():
            low, high = points[near].min(axis=0), points[near].max(axis=0)
            # The fewer lines, the further they stay from its edge
            rim = MARGIN + UNSEEN / near.sum() * (high - low).max()
            found[number] = _Rectangle(rectangle.axis, rectangle.sign, rectangle.offset, low, high).grown(float(rim))
    return found


def _gathered(lines: Lines, axis: int, sign: int, offset: float, bounds: tuple[np.ndarray, np.ndarray],
              fewest: float) -> Iterator[tuple[_Rectangle, float]]:
    """Rectangles about places where many lines cross a plane, and how many lines for their area."""
    aside = [other for other in range(3) if other != axis]
    points, outward = _crossings(lines, axis, sign, offset)
    points = points[outward & (points > bounds[0][aside]).all(axis=1) & (points < bounds[1][aside]).all(axis=1)]
    if len(points) < fewest:
        return
    cells = np.floor((points - bounds[0][aside]) / CELL).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, bool)
    grid[tuple(cells.T)] = True
    labels, count = ndimage.label(ndimage.binary_dilation(grid), np.ones((3, 3)))
    number = labels[tuple(cells.T)] - 1
    for one in np.flatnonzero(np.bincount(number, minlength=count) >= fewest):
        own = points[number == one]
        low, high = own.min(axis=0), own.max(axis=0)
        yield _Rectangle(axis, sign, offset, low, high), len(own) / (np.prod(high - low) + SMALLEST)


def _crossings(lines: Lines, axis: int, sign: int, offset: float) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) where lines cross a plane, and (N,) which of them do so outwards."""
    speed, way = lines.directions[:, axis], offset - lines.origins[:, axis]
    outward = (speed * sign > 1e-6) & (way * sign > 0)
    step = np.where(outward, way, 0) / np.where(outward, speed, 1)
    return np.delete(lines.origins + step[:, None] * lines.directions, axis, axis=1), outward


def _any(rectangles: Sequence[_Rectangle], lines: Lines) -> np.ndarray:
    return np.any([np.zeros(len(lines.origins), bool), *(each.holds(lines) for each in rectangles)], axis=0)


def _offsets(corners: np.ndarray, axis: int) -> np.ndarray:
    """Where planes square to an axis lie: those with the most built in them, and both ends."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    flat = np.abs(cross[:, axis]) > FLAT * np.maximum(area, 1e-12)
    places = np.round(corners[flat, :, axis].mean(axis=1) / BIN).astype(int)
    names, which = np.unique(places, return_inverse=True)
    built = np.bincount(which, area[flat])
    means = np.bincount(which, area[flat] * corners[flat, :, axis].mean(axis=1)) / np.maximum(built, 1e-12)
    largest = means[np.argsort(-built, kind="stable")[:PLANES]] if len(names) else means
    return np.array([corners[..., axis].min(), corners[..., axis].max(), *largest])


def _turned(building: Sequence[Geometry]) -> np.ndarray:
    """(3, 3) rotation about +Z to axes along the walls: the mean of their directions, of which four are one."""
    corners = np.concatenate([each.reshape(-1, 3, 3) for each in corners_of(building)])
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    fourfold = np.sum(np.hypot(*cross.T[:2]) * np.exp(4j * np.arctan2(cross[:, 1], cross[:, 0])))
    angle = np.angle(fourfold) / 4 if abs(fourfold) > 1e-9 else 0.0
    c, s = np.cos(angle), np.sin(angle)
    return np.array([(c, s, 0), (-s, c, 0), (0, 0, 1.0)])


def _portal(rectangle: _Rectangle, turn: np.ndarray) -> PortalPlan:
    """The opening in the world; of its two sides the first is turned so that right x up points inward."""
    first, second = (other for other in range(3) if other != rectangle.axis)
    corner, right, up = np.zeros(3), np.zeros(3), np.zeros(3)
    corner[[rectangle.axis, first, second]] = rectangle.offset, *rectangle.low
    right[first], up[second] = rectangle.high - rectangle.low
    if np.cross(right, up)[rectangle.axis] * rectangle.sign > 0:
        corner, right = corner + right, -right
    return PortalPlan(corner=_vector(corner @ turn), right=_vector(right @ turn), up=_vector(up @ turn))


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
