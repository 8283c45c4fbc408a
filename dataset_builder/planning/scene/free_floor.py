"""Free floor of a scene given as triangles: where something of a size can stand, clear of all that is there."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from dataset_builder.geometry.surface_points import surface_points
from dataset_builder.planning.scene.footprints import WALL_GAP, Footprint
from dataset_builder.planning.scene.storeys import MIN_FLOOR, STEP, Grid, Storey, connected

HEAD_ROOM = 1.0
"""Metres that are clear above free floor, even for lower things: under a table is no place."""
TALLEST = 20.0
"""Metres above a floor up to which anything is looked at."""
NARROW = 0.3
"""Metres that free floor is wide about some point of it: less is the inside of a wall or of a wardrobe."""
DOOR = 0.4
"""Half the width of a door, metres: rooms are what is left of a floor that is worn down by it."""
CLASSES = 0.25
"""Metres of height in which things share one map of free floor, that of the lowest."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeFloor:
    """One storey with what stands on it, over a grid of N cells."""

    grid: Grid
    storey: Storey
    top: np.ndarray
    """(N,) what things stand on: the floor, or a carpet on it, metres."""
    clear: np.ndarray
    """(N,) metres above the floor without anything."""
    bare: np.ndarray
    """(N,) the same of the building alone."""
    points: np.ndarray
    """(K, 3) points that stand in the way, in the order of cells."""
    starts: np.ndarray
    """(N + 1,) the first point of each cell."""
    _wide: dict[float, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, init=False)
    """By least head room: free cells, those furthest from what is not free first, and how far, below 0."""

    @property
    def rooms(self) -> int:
        """How many there are, doors closed."""
        apart = self._open(self.bare, HEAD_ROOM)
        worn = self._width(apart) > DOOR
        sizes = np.bincount(connected(self.grid, worn, self.storey.height, np.inf)[worn])
        return int((sizes > 0).sum())

    @property
    def area(self) -> float:
        """Square metres of free floor."""
        return len(self.places(HEAD_ROOM, 0.0)) * self.grid.cell**2

    def places(self, height: float, half: float) -> np.ndarray:
        """(C,) cells about which something of a height, and of `half` metres to its nearer sides, may be able to stand:
        none other has its middle there."""
        needed = max(HEAD_ROOM, height // CLASSES * CLASSES)
        if needed not in self._wide:
            width = self._width(self._open(self.clear, needed))
            order = np.argsort(-width, kind="stable")[:np.count_nonzero(width)]
            self._wide[needed] = order, -width[order]
        order, nearer = self._wide[needed]
        return order[:np.searchsorted(nearer, self.grid.cell - half - WALL_GAP)]

    def _open(self, clear: np.ndarray, height: float) -> np.ndarray:
        """(N,) bool: floor under enough clear air, in parts that are neither small nor narrow."""
        mask = self.storey.floor & (clear >= height)
        labels = connected(self.grid, mask, self.storey.height, max(STEP, self.grid.cell))
        wide = np.zeros(labels.max(initial=0) + 1)
        np.maximum.at(wide, labels, self._width(mask))
        large = np.bincount(labels, minlength=len(wide)) * self.grid.cell**2 >= MIN_FLOOR
        return mask & (large & (wide >= min(NARROW, 6 * self.grid.cell)))[labels]

    def _width(self, mask: np.ndarray) -> np.ndarray:
        found: np.ndarray = distance_transform_edt(np.pad(mask.reshape(self.grid.shape), 1))[1:-1, 1:-1]
        return found.ravel() * self.grid.cell

    def under(self, box: Footprint) -> np.ndarray:
        """(C,) cells of which a footprint covers the middle, or its own middle."""
        own = self._about(box, 0.0)
        offset = (self.grid.middles(own) - box.centre) @ box.axes.T
        covered = own[(np.abs(offset) <= box.half).all(axis=1)]
        return covered if len(covered) else self.grid.indices(np.array([box.centre]))

    def _about(self, box: Footprint, gap: float) -> np.ndarray:
        """(C,) cells within the bounds of a footprint grown by `gap`."""
        rows = self._rows(box, gap)
        return np.concatenate([np.arange(first, last + 1) for first, last in rows]) if rows else np.zeros(0, np.int64)

    def _rows(self, box: Footprint, gap: float) -> list[tuple[int, int]]:
        """First and last cell of each column of the grid within the bounds of a footprint grown by `gap`."""
        corners = np.array([box.corners().min(axis=0) - gap, box.corners().max(axis=0) + gap])
        low, high = np.floor((corners - self.grid.low) / self.grid.cell).astype(int)
        columns, rows = self.grid.shape
        (i0, j0), (i1, j1) = np.maximum(low, 0), np.minimum(high, [columns - 1, rows - 1])
        return [(i * rows + j0, i * rows + j1) for i in range(i0, i1 + 1)] if j0 <= j1 else []

    def stands_on(self, box: Footprint) -> float | None:
        """Height that a footprint comes to stand at, None where there is no floor under its middle."""
        middle = self.grid.indices(np.array([box.centre]))[0]
        if middle < 0 or not self.storey.floor[middle]:
            return None
        return float(self.top[self.under(box)].max())

    def blocked(self, box: Footprint) -> bool:
        """Whether anything comes nearer than WALL_GAP to the sides of a box, or into it from above."""
        gap, own = WALL_GAP - 1e-4, self.under(box)
        if (self.clear[own] + self.storey.height[own] < box.top - gap).any():
            return True
        slices = [self.points[self.starts[first]:self.starts[last + 1]] for first, last in self._rows(box, gap)]
        points = np.concatenate(slices) if slices else np.zeros((0, 3))
        across = np.abs((points[:, :2] - box.centre) @ box.axes.T) < np.asarray(box.half) + gap
        return bool((across.all(axis=1) & (points[:, 2] < box.top - 1e-6) & (points[:, 2] > box.bottom)).any())


def bare_floor(grid: Grid, storey: Storey, building: Iterable[np.ndarray]) -> FreeFloor:
    """A storey with what is built on it. building: corners of triangles (T, 3, 3)."""
    nothing = np.full(len(storey.height), TALLEST)
    floor = furnished(FreeFloor(grid=grid, storey=storey, top=storey.height, clear=nothing, bare=nothing,
                                points=np.zeros((0, 3)), starts=np.zeros(len(nothing) + 1, np.int64)), building)
    return replace(floor, bare=floor.clear)


def furnished(floor: FreeFloor, contents: Iterable[np.ndarray]) -> FreeFloor:
    """The storey with more on it. contents: corners of triangles (T, 3, 3)."""
    grid, storey, spacing = floor.grid, floor.storey, floor.grid.cell / 2
    top, clear, kept = floor.top.copy(), floor.clear.copy(), [floor.points]
    for part in contents:
        for points in surface_points(_within_reach(grid, storey, part), spacing):
            kept.append(_add(grid, storey, points, top, clear, spacing))
    points = np.concatenate(kept)
    cells = grid.indices(points)
    order = np.argsort(cells, kind="stable")
    starts = np.searchsorted(cells[order], np.arange(len(storey.height) + 1))
    return FreeFloor(grid=grid, storey=storey, top=top, clear=clear, bare=floor.bare, points=points[order],
                     starts=starts)


def _within_reach(grid: Grid, storey: Storey, corners: np.ndarray) -> np.ndarray:
    """Triangles that are not wholly below the floor or above what is looked at."""
    height = storey.height[storey.floor]
    cap = np.minimum(storey.roof[storey.floor] + 1.0, TALLEST)
    z = corners[:, :, 2]
    return corners[(z.max(axis=1) > height.min()) & (z.min(axis=1) < (height + cap).max())]


def _add(grid: Grid, storey: Storey, points: np.ndarray, top: np.ndarray, clear: np.ndarray,
         spacing: float) -> np.ndarray:
    """Lower `clear`, and raise `top` by what is flat, for points (N, 3); those that stand in the way come back."""
    cells = grid.indices(points)
    points, cells = points[cells >= 0], cells[cells >= 0]
    above = points[:, 2] - storey.height[cells]
    flat = (above > 0) & (above <= STEP)
    np.maximum.at(top, cells[flat], points[flat, 2])
    # Straight under a sloping roof the middle of a cell is not its lowest point
    high = (above > STEP) & (above < np.minimum(storey.roof[cells] + 2 * grid.cell + STEP, TALLEST))
    lowered = above[high] - spacing
    np.minimum.at(clear, cells[high], np.where(lowered <= STEP, 0.0, above[high]))
    points = points[high]
    x, y, z = np.floor((points - [*grid.low, storey.height.min()]) / (spacing / 2)).astype(np.int64).T
    _, once = np.unique((x * (8 * grid.shape[1]) + y) * (1 << 20) + z, return_index=True)
    return points[once]
