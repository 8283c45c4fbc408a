"""How fine textures need to be for what a camera can see of them: a house has hundreds, and few of them are near."""

from itertools import pairwise

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.rendering.scene.triangle_soup import Soup

SHARE = 0.99
"""Of the area of a material as the camera would see it from in front: the rest, slivers of the unwrapping, may be
coarser."""
MIN_SIDE = 16
"""Texels along a side that every texture keeps, where it has them."""
STRIP = 1 << 14
"""Triangles at a time: what is found on the way is ten times as large."""
MIN_DISTANCE = 1e-6
"""Of the camera from a surface, in lengths of its frame."""


def seen_sides(soup: Soup, camera: Pinhole, texels_per_pixel: float, most: int) -> tuple[int, ...]:
    """Longest side in texels that the texture of each material of a soup needs, at most `most`: a power of two.

    A texture is as fine as `texels_per_pixel` asks for where its surface is nearest to the camera and faces it,
    wherever the camera looks: in a plane mirror, things are only further away. Both lengths of the soup and the camera
    are of one frame.
    """
    needed, seen = np.empty((2, len(soup.corners)))
    for first in range(0, len(needed), STRIP):
        some = slice(first, first + STRIP)
        corners = soup.corners[some].astype(float)
        pixels = camera.focal / np.maximum(distances(camera.position, corners), MIN_DISTANCE)
        needed[some] = texels_per_pixel * pixels * repeat_lengths(corners, soup.uvs[some].astype(float))
        seen[some] = pixels**2 * _areas(corners)
    order = np.argsort(soup.material, kind="stable")
    ends = np.searchsorted(soup.material[order], np.arange(len(soup.materials) + 1))
    faces = [order[first:last] for first, last in pairwise(ends)]
    return tuple(_side(needed[own], seen[own], most) if len(own) else MIN_SIDE for own in faces)


def _side(needed: np.ndarray, weight: np.ndarray, most: int) -> int:
    """The power of two that suffices for `SHARE` of the weights (N,)."""
    order = np.argsort(needed)
    total = np.cumsum(weight[order])
    enough = needed[order][min(int(np.searchsorted(total, SHARE * total[-1])), len(order) - 1)]
    if not enough < most:
        return most
    return min(most, max(MIN_SIDE, 1 << int(np.ceil(np.log2(max(enough, 1.0))))))


def repeat_lengths(corners: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """(F,) longest way along a surface that one repeat of its texture takes: the largest singular value of the
    derivative of places (F, 3, 3) by texture coordinates (F, 3, 2). Infinite where coordinates do not change."""
    edges, steps = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    (a, b), (c, d) = steps[:, 0].T, steps[:, 1].T
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], 1) / (a * d - b * c)[:, None, None]
        along = np.einsum("fij,fjk->fik", inverse, edges)
        squares = np.einsum("fik,fjk->fij", along, along)
        half = (squares[:, 0, 0] + squares[:, 1, 1]) / 2
        root = np.sqrt((squares[:, 0, 0] - squares[:, 1, 1]) ** 2 / 4 + squares[:, 0, 1] ** 2)
        return np.nan_to_num(np.sqrt(half + root), nan=np.inf)


def distances(point: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(F,) distances of a point (3,) from triangles (F, 3, 3): to the foot of its perpendicular where that is inside,
    else to the nearest edge (Ericson, "Real-time collision detection", 2005, section 5.1)."""
    starts, ends = corners, np.roll(corners, -1, axis=1)
    along, to = ends - starts, point - starts
    length = np.maximum(np.einsum("fek,fek->fe", along, along), np.finfo(float).tiny)
    share = np.clip(np.einsum("fek,fek->fe", to, along) / length, 0, 1)
    nearest = np.linalg.norm(to - share[..., None] * along, axis=2).min(axis=1)
    normal = np.cross(along[:, 0], -along[:, 2])
    size = np.linalg.norm(normal, axis=1)
    beside = np.einsum("fek,fk->fe", np.cross(along, to), normal)
    height = np.abs(np.einsum("fk,fk->f", to[:, 0], normal)) / np.maximum(size, np.finfo(float).tiny)
    return np.where((beside > 0).all(axis=1) & (size > 0), np.minimum(height, nearest), nearest)


def _areas(corners: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
