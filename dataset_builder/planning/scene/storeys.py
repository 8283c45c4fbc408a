"""Floors of a scene given as triangles: at which heights, over which cells of a grid, and what is above them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dataset_builder.geometry.raycast import RayScene

CELL, MOST_CELLS = 0.05, 400_000
"""Metres along a side, and cells of the grid; large scenes have larger cells."""
STEP = 0.05
"""Metres: what lies flatter than this on a floor is floor, as carpets are."""
BIN, TILT = 0.05, 0.7
"""Metres between heights that count as one; least vertical part of a floor's normal."""
BAND, LOOSE_BAND = 0.9, 0.25
"""Metres about its level that a storey reaches: split levels and slopes belong to it. The second holds where nothing
says what is floor, so that beds are not."""
LOOSE_SHARE = 0.25
"""Of the largest level's area that another has at least, where nothing says what is floor."""
MOST_STOREYS = 12
MIN_FLOOR = 1.0
"""Square metres of a floor, or of a free part of one."""
ROOFED, ROOM = 0.05, 8.0
"""Share of all floor, or square metres of it, under a roof from which on the rest counts as outdoors and as no place:
outer roofs, the street."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Square cells over a scene."""

    low: np.ndarray
    """(2,) corner of the first cell."""
    shape: tuple[int, int]
    cell: float
    """Side, metres."""

    @classmethod
    def over(cls, low: np.ndarray, high: np.ndarray) -> "Grid":
        """Cells over all from `low` to `high` (3,), and one around; as small as CELL where that is not too many."""
        size = (high - low)[:2]
        cell = max(CELL, float(np.sqrt(size.prod() / MOST_CELLS)), float(size.max()) / MOST_CELLS)
        columns, rows = (int(count) for count in np.ceil(size / cell) + 2)
        return cls(low=low[:2] - cell, shape=(columns, rows), cell=cell)

    def middles(self, cells: np.ndarray) -> np.ndarray:
        """(C, 2) middles of cells (C,)."""
        return np.asarray(self.low + (np.stack(np.divmod(cells, self.shape[1]), axis=1) + 0.5) * self.cell)

    def indices(self, points: np.ndarray) -> np.ndarray:
        """(N,) cell of each of points (N, 2 or more), by rows of the grid; -1 outside."""
        i, j = np.floor((points[:, :2] - self.low) / self.cell).astype(np.int64).T
        inside = (i >= 0) & (i < self.shape[0]) & (j >= 0) & (j < self.shape[1])
        return np.where(inside, i * self.shape[1] + j, -1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Storey:
    """One floor, over a grid of N cells."""

    floor: np.ndarray
    """(N,) bool: whether there is floor at the middle of a cell."""
    height: np.ndarray
    """(N,) where it lies, metres; that of the nearest cell where there is none."""
    roof: np.ndarray
    """(N,) metres from there to what is built above; inf under the sky."""


def areas_facing_up(corners: np.ndarray, *, either: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """(K,) heights and (K,) areas of those of triangles (T, 3, 3) that face up, or up or down."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    area = np.linalg.norm(normal, axis=1)
    up = (np.abs(normal[:, 2]) if either else normal[:, 2]) > TILT * area
    return corners[up, :, 2].mean(axis=1), area[up]


def levels(heights: np.ndarray, areas: np.ndarray, least: float) -> list[float]:
    """Heights of storeys, largest first: peaks of the histogram of height by area, with more than `least` square metres
    and two bands apart."""
    if not len(heights):
        return []
    bins = np.floor((heights - heights.min()) / BIN).astype(np.int64)
    own = np.bincount(bins, weights=areas)
    # A floor may lie on the border of two bins
    area = own + np.append(own[1:], 0)
    found = list[float]()
    while len(found) < MOST_STOREYS and area.max() > least:
        peak = int(area.argmax())
        found.append(float(heights.min()) + (peak + 1) * BIN)
        reach = round(2 * BAND / BIN)
        area[max(peak - reach, 0):peak + reach] = 0
    return found


def find_storeys(grid: Grid, up: tuple[np.ndarray, np.ndarray], ground: RayScene, house: RayScene,
                 loose: bool) -> list[Storey]:
    """Storeys, lowest first. up: heights and areas of faces that may be floor. ground: what floors are of; house: what
    may be a roof. loose: nothing says what is floor."""
    heights, areas = up
    order = np.argsort(heights, kind="stable")
    least = max(MIN_FLOOR, LOOSE_SHARE * _most_at_once(heights[order], areas[order]) if loose else 0.0)
    band = LOOSE_BAND if loose else BAND
    found = [_storey(grid, level, band, ground, house) for level in sorted(levels(heights, areas, least))]
    covered = sum(int((each.floor & np.isfinite(each.roof)).sum()) for each in found)
    if covered > min(ROOFED * sum(int(each.floor.sum()) for each in found), ROOM / grid.cell**2):
        found = [Storey(floor=each.floor & np.isfinite(each.roof), height=each.height, roof=each.roof)
                 for each in found]
    return [each for each in map(lambda one: _large_parts(grid, one), found) if each.floor.any()]


def _most_at_once(heights: np.ndarray, areas: np.ndarray) -> float:
    """Largest area within one bin of height, sorted."""
    total = np.concatenate([[0.0], np.cumsum(areas)])
    return float((total[np.searchsorted(heights, heights + BIN, "right")] - total[:-1]).max(initial=0.0))


def _storey(grid: Grid, level: float, band: float, ground: RayScene, house: RayScene) -> Storey:
    """What rays down from the top of the band meet, one in the middle of each cell."""
    centres = grid.middles(np.arange(grid.shape[0] * grid.shape[1]))
    above = np.column_stack([centres, np.full(len(centres), level + band)])
    down, up = np.tile([0.0, 0.0, -1.0], (len(above), 1)), np.tile([0.0, 0.0, 1.0], (len(above), 1))
    distance = ground.first_hit(above, down)[1]
    floor = distance < 2 * band
    floor[floor] = ground.normals(above[floor], down[floor])[:, 2] > TILT
    height, roof = np.where(floor, (level + band - distance).round(5), level), np.full(len(centres), np.inf)
    if floor.any():
        start = np.column_stack([centres, height + 2 * STEP])
        roof[floor] = house.first_hit(start[floor], up[floor])[1] + 2 * STEP
        missing = ~floor.reshape(grid.shape)
        nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
        height, roof = (field.reshape(grid.shape)[tuple(nearest)].ravel() for field in (height, roof))
    return Storey(floor=floor, height=height, roof=roof)


def _large_parts(grid: Grid, storey: Storey) -> Storey:
    """The storey without parts of the floor that are smaller than MIN_FLOOR: sills, tops of walls."""
    near = max(STEP, grid.cell * TILT)
    labels = connected(grid, storey.floor, storey.height, near)
    large = np.bincount(labels, minlength=1) * grid.cell**2 >= MIN_FLOOR
    return Storey(floor=storey.floor & large[labels], height=storey.height, roof=storey.roof)


def connected(grid: Grid, mask: np.ndarray, height: np.ndarray, near: float) -> np.ndarray:
    """(N,) number of the part that each cell of a mask (N,) is in; cells next to each other are of one part where their
    heights differ by at most `near`. Cells that are not in the mask are parts of their own."""
    number = np.arange(len(mask)).reshape(grid.shape)
    pairs = np.concatenate([np.stack([number[:-1].ravel(), number[1:].ravel()]),
                            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()])], axis=1)
    one, other = pairs
    joined = mask[one] & mask[other] & (np.abs(height[one] - height[other]) <= near)
    graph = coo_array((np.ones(int(joined.sum()), bool), (one[joined], other[joined])), shape=(len(mask), len(mask)))
    labels: np.ndarray = connected_components(graph, directed=False)[1]
    return labels


def corners_of(parts: Sequence[tuple[np.ndarray, np.ndarray, int]]) -> list[np.ndarray]:
    """(T, 3, 3) corners of the triangles of each part."""
    return [positions[faces] for positions, faces, _ in parts]
