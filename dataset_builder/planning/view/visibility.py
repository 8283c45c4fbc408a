"""What a camera sees of the target, on a coarse grid of rays: coverage, visible share of its silhouette, points."""

from dataclasses import dataclass
from math import radians, sqrt, tan

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole, look_at, unit
from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE, Arrangement

GRID = 48
"""Rays along a side of a square frame; other aspects get as many in all."""
MARGIN = 2
"""How many times as wide and high as the frame the silhouette is looked for, so that cut parts count."""
OUTLINE_GRID = 40


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """What a frame shows of the target."""

    coverage: float
    """Share of the frame where the target is seen."""
    solid: float
    """Area of its whole silhouette, hidden and cut parts too, over the frame's area."""
    visibility: float
    """`coverage` over `solid`."""
    framed: float
    """Share of its whole silhouette that the frame does not cut."""
    points: np.ndarray
    """(N, 3) where the target is seen, metres."""
    normals: np.ndarray
    """(N, 3) geometric normals there, turned to the camera."""


def rays(frame: Pinhole, grid: int = GRID, margin: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) unit directions through pixel centres of a grid `margin` frames wide; (N,) whether in the frame."""
    columns = max(round(grid / sqrt(frame.aspect)), 1)
    rows = max(round(grid * sqrt(frame.aspect)), 1)
    x, y = np.meshgrid(_centres(columns, margin), _centres(rows, margin))
    half = tan(radians(frame.fov) / 2)
    plane = np.stack([x * half, y * half * frame.aspect, np.ones_like(x)], axis=-1).reshape(-1, 3)
    inside = (np.maximum(np.abs(x), np.abs(y)) < 1).reshape(-1)
    return unit(plane @ frame.basis), inside


def _centres(count: int, margin: int) -> np.ndarray:
    """Pixel centres of `count * margin` pixels, where [-1, 1] is the frame; `margin` frames fit around its middle."""
    return ((np.arange(count * margin) + 0.5) / (count * margin) * 2 - 1) * margin


def _spread(position: np.ndarray, count: int) -> np.ndarray:
    return np.broadcast_to(position, (count, 3))


def look(arrangement: Arrangement, frame: Pinhole, grid: int = GRID) -> Sight:
    """Cast the frame and its margin at the target alone, then the rays that met it in the frame at everything."""
    directions, inside = rays(frame, grid, MARGIN)
    _, alone = arrangement.alone.first_hit(_spread(frame.position, len(directions)), directions)
    met = np.isfinite(alone)
    ways = directions[met & inside]
    ids, distance = arrangement.everything.first_hit(_spread(frame.position, len(ways)), ways)
    seen = ids == TARGET_INSTANCE
    points = frame.position + ways[seen] * distance[seen, None]
    pixels = int(inside.sum())
    return Sight(coverage=int(seen.sum()) / pixels, solid=int(met.sum()) / pixels,
                 visibility=int(seen.sum()) / max(int(met.sum()), 1),
                 framed=int((met & inside).sum()) / max(int(met.sum()), 1), points=points,
                 normals=arrangement.alone.normals(_spread(frame.position, int(seen.sum())), ways[seen]))


def silhouette_area(arrangement: Arrangement, direction: np.ndarray) -> float:
    """Area in square metres of the target's silhouette seen from far along unit `direction` (3,)."""
    right, up, forward = look_at(direction, np.zeros(3))
    offsets = _centres(OUTLINE_GRID, 1) * arrangement.radius
    x, y = (axis.reshape(-1, 1) for axis in np.meshgrid(offsets, offsets))
    origins = arrangement.centre + direction * 2 * arrangement.radius + x * right + y * up
    _, distance = arrangement.alone.first_hit(origins, np.broadcast_to(forward, origins.shape))
    share = float(np.isfinite(distance).mean())
    return max(share, 1 / OUTLINE_GRID**2) * (2 * arrangement.radius) ** 2


def window_share(arrangement: Arrangement, frame: Pinhole) -> float:
    """Share of the frame in the smallest rectangle that holds the target's projection; 1 where it reaches behind."""
    positions = np.concatenate([part[0] for part in arrangement.geometry if part[2] == TARGET_INSTANCE])
    right, up, forward = ((positions - frame.position) @ frame.basis.T).T
    if forward.min() <= 0:
        return 1.0
    half = tan(radians(frame.fov) / 2)
    x, y = np.clip(right / forward / half, -1, 1), np.clip(up / forward / half / frame.aspect, -1, 1)
    return float(np.ptp(x) * np.ptp(y) / 4)
