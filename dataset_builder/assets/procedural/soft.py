"""Soft solids: rounded cushions with a crown, pillows with a seam, blankets hanging over an edge."""

import numpy as np

from dataset_builder.assets.procedural.boxes import box_uvs, facing, lattice_box, solid, split_quads, with_uvs
from dataset_builder.geometry.mesh import TriangleMesh

ARC_STEPS = 3
"""Facets per eighth of a circle where nothing else is asked for: 15 degrees from one to the next."""


def _cuts(half: float, radius: float, inner_steps: int, arc_steps: int) -> np.ndarray:
    """Lattice cuts of one axis: even in angle where the side is rounded, even in length between."""
    arc = radius * np.tan(np.linspace(0, np.pi / 4, arc_steps + 1))
    inner = half - radius
    middle = np.linspace(-inner, inner, inner_steps + 1)[1:-1] if inner > 1e-6 else np.empty(0)
    flank = inner + arc if inner > 1e-6 else arc[1:]
    centre = np.empty(0) if inner > 1e-6 else np.zeros(1)
    return np.concatenate([-flank[::-1], middle, centre, flank])


def cushion(size: tuple[float, float, float], *, radius: float, crown: float = 0.0, inner_steps: int = 2,
            arc_steps: int = ARC_STEPS) -> TriangleMesh:
    """Box of `size` about the origin with edges rounded by `radius`; its upper half swells in the middle.

    The outer extent stays `size`: with `crown` > 0 the rims lie lower than the middle by that share of the height.
    """
    half = np.asarray(size) / 2
    round_by = min(radius, float(half.min()))
    across = (_cuts(half[0], round_by, inner_steps, arc_steps), _cuts(half[1], round_by, inner_steps, arc_steps))
    points, quads = lattice_box((*across, _cuts(half[2], round_by, 1, arc_steps)))
    faces = split_quads(quads)
    axis, sign = facing(points[faces])
    core = np.clip(points, -(half - round_by), half - round_by)
    spread = points - core
    positions = core + round_by * spread / np.linalg.norm(spread, axis=1, keepdims=True)
    uvs = box_uvs(positions[faces], axis, sign, grain=1)
    return with_uvs(_crowned(positions, half, crown), faces, uvs)


def _crowned(positions: np.ndarray, half: np.ndarray, crown: float) -> np.ndarray:
    """Positions whose upper half is lowered towards the rim by up to `crown` of the height."""
    across = np.clip(1 - (positions[:, :2] / half[:2]) ** 2, 0, 1).prod(axis=1)
    up = np.clip(positions[:, 2] / half[2], 0, None)
    lowered = positions.copy()
    lowered[:, 2] -= crown * 2 * half[2] * up * (1 - across)
    return lowered


def pillow(size: tuple[float, float, float], *, steps: int = 12) -> TriangleMesh:
    """Knife-edged pillow of `size` about the origin: two swollen sides that meet in a seam, its corners drawn out."""
    ramp = np.sin(np.linspace(-1, 1, steps + 1) * np.pi / 2)
    points, quads = lattice_box((ramp, ramp, np.array([-1.0, 1.0])))
    seam = (np.abs(points[:, :2]) >= 1).any(axis=1)
    x, y = points[:, 0], points[:, 1]
    thickness = ((1 - x**2) * (1 - y**2)) ** 0.4
    waist = 1 - 0.07 * np.stack([1 - y**2, 1 - x**2], axis=-1)
    shaped = np.concatenate([points[:, :2] * waist, (points[:, 2] * thickness)[:, None]], axis=1)
    shaped[:, :2] /= np.abs(shaped[:, :2]).max(axis=0)
    merged, faces = _weld_seam(shaped * np.asarray(size) / 2, split_quads(quads), seam)
    return solid(merged, faces, grain=1)


def _weld_seam(positions: np.ndarray, faces: np.ndarray, seam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge the vertices of the seam that coincide, and drop the faces between them."""
    keys = positions.round(9)
    keys[~seam] += np.arange(len(positions))[~seam, None] + 1e3
    _, first, merged = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    welded = merged.reshape(-1)[faces]
    whole = (welded[:, 0] != welded[:, 1]) & (welded[:, 1] != welded[:, 2]) & (welded[:, 2] != welded[:, 0])
    return positions[first], welded[whole]


def draped(path: np.ndarray, *, thickness: float, length: float, steps: int, ripple: np.ndarray) -> TriangleMesh:
    """Cloth of `thickness` lying outside `path` (K, 2) in x and z, `length` long in y (centred): a blanket over a bed.

    The path runs clockwise seen from -Y (left side up, over, right side down). `ripple` (K, steps + 1) lifts the cloth
    off the path, in metres, >= 0; both of its faces rise together.
    """
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
    y = np.linspace(-length / 2, length / 2, steps + 1)
    sheets = [_sheet(path, normal, y, ripple + lift) for lift in (0.0, thickness)]
    count = len(path) * len(y)
    index = np.arange(count).reshape(len(path), len(y))
    inner = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    after = np.roll(rim, -1)
    edge = np.stack([rim, rim + count, after + count, after], axis=-1)
    faces = split_quads(np.concatenate([inner[:, ::-1], inner + count, edge[:, ::-1]]))
    return solid(np.concatenate(sheets), faces, grain=1)


def _sheet(path: np.ndarray, normal: np.ndarray, y: np.ndarray, lift: np.ndarray) -> np.ndarray:
    """(K * len(y), 3) points of the path moved along its normal by `lift` (K, len(y))."""
    flat = path[:, None] + normal[:, None] * lift[..., None]
    along = np.broadcast_to(y, lift.shape)
    return np.stack([flat[..., 0], along, flat[..., 1]], axis=-1).reshape(-1, 3)
