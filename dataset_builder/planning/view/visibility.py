"""What a camera sees of the target, on a coarse grid of rays: coverage, visible share of its silhouette, points."""

from dataclasses import dataclass
from math import radians, sqrt, tan

import numpy as np

from dataset_builder.label.example_plan import CameraPlan
from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE, Arrangement

GRID = 48
"""Rays along a side of a square frame; other aspects get as many in all."""
MARGIN = 2
"""How many times as wide and high as the frame the silhouette is looked for, so that cut parts count."""
OUTLINE_GRID = 40


@dataclass(frozen=True, kw_only=True, eq=False)
class Pinhole:
    """A pinhole camera, Z up: position and target (3,), horizontal fov in degrees, aspect = height / width."""

    position: np.ndarray
    target: np.ndarray
    fov: float
    aspect: float

    @property
    def basis(self) -> np.ndarray:
        """(3, 3) rows right, up and forward, in the world."""
        forward = _unit(self.target - self.position)
        right = _unit(np.cross(forward, [0.0, 0.0, 1.0]))
        return np.stack([right, np.cross(right, forward), forward])

    def rays(self, grid: int = GRID, margin: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) unit directions through pixel centres of a grid `margin` frames wide; (N,) whether in the frame."""
        columns = max(round(grid / sqrt(self.aspect)), 1)
        rows = max(round(grid * sqrt(self.aspect)), 1)
        x, y = np.meshgrid(_centres(columns, margin), _centres(rows, margin))
        half = tan(radians(self.fov) / 2)
        plane = np.stack([x * half, y * half * self.aspect, np.ones_like(x)], axis=-1).reshape(-1, 3)
        inside = (np.maximum(np.abs(x), np.abs(y)) < 1).reshape(-1)
        return _unit(plane @ self.basis), inside


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """What a frame shows of the target.

    coverage: share of the frame where the target is seen. solid: area of its whole silhouette, hidden and cut parts
    too, over the frame's area. visibility: coverage / solid. points, normals: (N, 3) where the target is seen, metres,
    and geometric normals turned to the camera.
    """

    coverage: float
    solid: float
    visibility: float
    points: np.ndarray
    normals: np.ndarray


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _centres(count: int, margin: int) -> np.ndarray:
    """Pixel centres of `count * margin` pixels, where [-1, 1] is the frame; `margin` frames fit around its middle."""
    return ((np.arange(count * margin) + 0.5) / (count * margin) * 2 - 1) * margin


def _spread(position: np.ndarray, count: int) -> np.ndarray:
    return np.broadcast_to(position, (count, 3))


def look(arrangement: Arrangement, frame: Pinhole, grid: int = GRID) -> Sight:
    """Cast the frame and its margin at the target alone, then the rays that met it in the frame at everything."""
    directions, inside = frame.rays(grid, MARGIN)
    _, alone = arrangement.alone.first_hit(_spread(frame.position, len(directions)), directions)
    met = np.isfinite(alone)
    rays = directions[met & inside]
    ids, distance = arrangement.everything.first_hit(_spread(frame.position, len(rays)), rays)
    seen = ids == TARGET_INSTANCE
    points = frame.position + rays[seen] * distance[seen, None]
    pixels = int(inside.sum())
    return Sight(coverage=int(seen.sum()) / pixels, solid=int(met.sum()) / pixels,
                 visibility=int(seen.sum()) / max(int(met.sum()), 1), points=points,
                 normals=arrangement.alone.normals(_spread(frame.position, int(seen.sum())), rays[seen]))


def silhouette_area(arrangement: Arrangement, direction: np.ndarray) -> float:
    """Area in square metres of the target's silhouette seen from far along unit `direction` (3,)."""
    far = Pinhole(position=direction, target=np.zeros(3), fov=90.0, aspect=1.0)
    right, up, forward = far.basis
    offsets = _centres(OUTLINE_GRID, 1) * arrangement.radius
    x, y = (axis.reshape(-1, 1) for axis in np.meshgrid(offsets, offsets))
    origins = arrangement.centre + direction * 2 * arrangement.radius + x * right + y * up
    _, distance = arrangement.alone.first_hit(origins, np.broadcast_to(forward, origins.shape))
    share = float(np.isfinite(distance).mean())
    return max(share, 1 / OUTLINE_GRID**2) * (2 * arrangement.radius) ** 2


def window_share(arrangement: Arrangement, camera: CameraPlan, aspect: float) -> float:
    """Share of the frame in the smallest rectangle that holds the target's projection; 1 where it reaches behind."""
    frame = Pinhole(position=np.asarray(camera.position), target=np.asarray(camera.target), fov=camera.fov,
                    aspect=aspect)
    positions = np.concatenate([part[0] for part in arrangement.geometry if part[2] == TARGET_INSTANCE])
    right, up, forward = ((positions - frame.position) @ frame.basis.T).T
    if forward.min() <= 0:
        return 1.0
    half = tan(radians(camera.fov) / 2)
    x, y = np.clip(right / forward / half, -1, 1), np.clip(up / forward / half / aspect, -1, 1)
    return float(np.ptp(x) * np.ptp(y) / 4)
