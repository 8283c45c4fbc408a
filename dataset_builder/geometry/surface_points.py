"""Points that lie on triangles so densely that nothing larger than their spacing slips between them."""

from collections.abc import Iterator

import numpy as np

CHUNK = 1 << 20
"""Points made at once, about: memory."""


def surface_points(corners: np.ndarray, spacing: float) -> Iterator[np.ndarray]:
    """(N, 3) points on triangles (T, 3, 3), in pieces: every point of a triangle is within `spacing` metres of one.
    Rows parallel to the longest edge, each as long as the triangle is wide there, so that
    slivers cost no more than their length.
    """
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    small = sides.max(axis=1, initial=0.0) <= spacing
    if small.any():
        yield corners[small, 0]
    corners, sides = corners[~small], sides[~small]
    order = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    start, end, top = np.take_along_axis(corners, order[:, :, None], axis=1).transpose(1, 0, 2)
    base = sides.max(axis=1, initial=0.0)
    height = np.linalg.norm(np.cross(end - start, top - start), axis=1) / np.maximum(base, 1e-30)
    # A triangle narrows from its longest edge up: straight below each point is a row, at most 0.8 spacings away, and on
    # it a point at most 0.5 aside
    rows = np.maximum(np.ceil(height / (0.8 * spacing)), 1).astype(np.int64) + 1
    count = rows * (np.ceil(base / spacing).astype(np.int64) // 2 + 2)
    cuts = np.flatnonzero(np.diff(np.cumsum(count) // CHUNK)) + 1
    for own in np.split(np.arange(len(corners)), cuts):
        if len(own):
            yield _on_rows(start[own], end[own], top[own], rows[own], spacing)


def _on_rows(start: np.ndarray, end: np.ndarray, top: np.ndarray, rows: np.ndarray, spacing: float) -> np.ndarray:
    """Points of all rows of triangles, given by base and apex (T, 3)."""
    triangle, row = _counted(rows)
    share = (row / (rows[triangle] - 1))[:, None]
    left = start[triangle] + share * (top - start)[triangle]
    right = end[triangle] + share * (top - end)[triangle]
    points = np.ceil(np.linalg.norm(right - left, axis=1) / spacing).astype(np.int64) + 1
    line, place = _counted(points)
    part = (place / np.maximum(points[line] - 1, 1))[:, None]
    return left[line] + part * (right - left)[line]


def _counted(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each of `counts[k]` members of k: k, and its number from 0."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
