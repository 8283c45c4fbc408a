"""What every reader holds the data of a file to, before it makes triangles of it."""

import warnings
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import counted, refuse
from dataset_builder.assets.readers.polygons import Triangulation, triangulated
from dataset_builder.digest import read_regular
from dataset_builder.spec.file_reference import MOST_BYTES

FARTHEST = 1e30
"""Areas of what is larger overflow."""


def content_of(path: Path) -> bytes:
    """The bytes of a file. Raises UserError where it cannot be read."""
    try:
        return read_regular(path, most=MOST_BYTES)
    except OSError as error:
        refuse(path, f"expected a readable file, got: {error.strerror}")


def numbers_of(text: bytes, dtype: type = np.float64) -> np.ndarray | None:
    """(N,) numbers of a text with blanks between them; None where something else stands in it."""
    if not text.strip():
        return np.zeros(0, dtype)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.fromstring(text, dtype=dtype, sep=" ")
    except (ValueError, DeprecationWarning):
        return None


def checked_triangles(path: Path, positions: np.ndarray, indices: np.ndarray, counts: np.ndarray, *,
                      at: str = "", kept: np.ndarray | None = None) -> Triangulation:
    """Triangles of the polygons with these (C,) corners, in runs of (F,) counts; (V, 3) positions.

    kept: which polygons become triangles; all, if not given. Raises UserError for vertices that are not finite or too
    far away, faces of fewer than 3 corners, and indices that are not vertices.
    """
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(bad):
        refuse(path, f"expected finite vertices, got {len(bad)} with NaN or Inf, first at vertex {bad[0]}", at=at)
    far = np.flatnonzero((np.abs(positions) > FARTHEST).any(axis=1))
    if len(far):
        refuse(path, f"expected vertices within {FARTHEST:g}, got {len(far)} beyond, first at vertex {far[0]}", at=at)
    few = np.flatnonzero(counts < 3)
    if len(few):
        refuse(path, f"expected faces of 3 or more corners, got {len(few)} with fewer, first at face {few[0]}, which "
                     f"has {counts[few[0]]}", at=at)
    outside = np.flatnonzero((indices < 0) | (indices >= len(positions)))
    if len(outside):
        faces = np.searchsorted(np.cumsum(counts), outside, side="right")
        refuse(path, f"expected indices in [0, {len(positions)}), got {len(np.unique(faces))} faces with others, first "
                     f"at face {faces[0]}, which has {indices[outside[0]]}", at=at)
    if kept is None or kept.all():
        return triangulated(positions, indices, counts)
    corners, faces = np.flatnonzero(np.repeat(kept, counts)), np.flatnonzero(kept)
    found = triangulated(positions, indices[corners], counts[kept])
    return Triangulation(corners=corners[found.corners], owner=faces[found.owner], crossed=faces[found.crossed])


def crossing(found: Triangulation) -> tuple[str, ...]:
    """What is doubtful about the triangles of polygons, in words."""
    many = len(found.crossed)
    return (f"{counted(many, 'face')} whose outline crosses itself, first face {found.crossed[0]}",) if many else ()


def polygon_counts(vertices: int, faces: int, found: Triangulation) -> str:
    """What a file of polygons holds, in words."""
    return ", ".join((counted(vertices, "vertex", "vertices"), counted(faces, "face"),
                      counted(len(found.corners), "triangle")))
