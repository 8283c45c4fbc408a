"""Where bodies of solid glass take the same space, and whether a priority says which of them owns it.

A body is what one material of one thing bounds. It overlaps another where a point of one of its closed pieces lies in
the other, or on it: liquid that fills a bottle exactly needs an owner of its surface as much as liquid that overlaps
the wall. Points that rays leave more often than they enter are inside; cavities are wound the other way and count so.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from dataset_builder.assets.asset import Asset, Material, is_solid
from dataset_builder.assets.glass_bodies import fill_of
from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.geometry.winding import WAYS, pieces

POINTS = 256
"""Of each piece, evenly chosen among the middles of its faces."""
TOUCH = 1e-3
"""Of a piece's extent: how far from its surface another may lie and touch it, within one thing. Things that stand on
each other touch, too, but with air between."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Part:
    """The faces of one asset that one glass has, in the asset's frame."""

    material: Material
    corners: np.ndarray
    """(F, 3, 3) metres."""
    piece: np.ndarray
    """(F,) numbers of pieces."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Body:
    """The same in the world, and the thing that it belongs to."""

    owner: str
    material: Material
    corners: np.ndarray
    piece: np.ndarray

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) lowest and highest corner."""
        return np.stack([self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))])

    @property
    def name(self) -> str:
        """As reasons name it."""
        return f"{self.material.name} of {self.owner}"


_known: WeakKeyDictionary[Asset, tuple[_Part, ...]] = WeakKeyDictionary()


def unowned_glass(things: Iterable[tuple[str, Asset, np.ndarray]]) -> tuple[str, ...]:
    """Pairs of bodies that overlap or touch without a priority that says which owns the space, in words.

    things: name, asset, and (4, 4) world_from_asset of each.
    """
    bodies = [_Body(owner=owner, material=part.material, piece=part.piece,
                    corners=_placed(part.corners, np.asarray(world)))
              for owner, asset, world in things for part in _parts(asset)]
    found = []
    for index, one in enumerate(bodies):
        for other in bodies[index:]:
            if not _owned(one, other) and _near(one, other) and (_meets(one, other) or _meets(other, one)):
                found.append(f"{one.name} in itself" if one is other else f"{one.name} and {other.name}")
    return tuple(dict.fromkeys(found))


def _parts(asset: Asset) -> tuple[_Part, ...]:
    """The glass of an asset, found once for as long as it is kept."""
    if asset not in _known:
        solid = [index for index in np.unique(asset.mesh.material).tolist() if is_solid(asset.materials[index])]
        piece = pieces(edges_of(asset.mesh.faces)) if solid else np.zeros(0, np.int64)
        _known[asset] = tuple(_Part(material=asset.materials[index], corners=asset.mesh.corners[own], piece=piece[own])
                              for index in solid for own in [asset.mesh.material == index])
    return _known[asset]


def _placed(corners: np.ndarray, world: np.ndarray) -> np.ndarray:
    """Corners in the world; a mirror turns the winding back."""
    moved = corners @ world[:3, :3].T + world[:3, 3]
    return moved[:, ::-1] if np.linalg.det(world[:3, :3]) < 0 else moved


def _owned(one: _Body, other: _Body) -> bool:
    """Whether it is known which of two bodies owns what both take: one kind of glass is one body."""
    mine, theirs = fill_of(one.material), fill_of(other.material)
    return mine is not None and theirs is not None and (mine == theirs or mine.priority != theirs.priority)


def _near(one: _Body, other: _Body) -> bool:
    (low, high), (lower, higher) = one.bounds, other.bounds
    return bool(np.all(low <= higher) and np.all(lower <= high))


def _meets(one: _Body, other: _Body) -> bool:
    """Whether a point of a piece of `one` that encloses a volume lies in `other`, its own piece aside."""
    volumes = np.bincount(one.piece, np.einsum("ij,ij->i", one.corners[:, 0] - one.bounds[0], np.cross(
        one.corners[:, 1] - one.bounds[0], one.corners[:, 2] - one.bounds[0])))
    (low, high), points, owners = other.bounds, list[np.ndarray](), list[np.ndarray]()
    for number in np.flatnonzero(volumes > 0).tolist():
        at = _points(one.corners[one.piece == number], TOUCH if one.owner == other.owner and one is not other else 0.0)
        at = at[np.all((at >= low) & (at <= high), axis=1)]
        points.append(at)
        owners.append(np.full(len(at), number))
    if not points or not sum(map(len, points)):
        return False
    own = np.concatenate(owners) if one is other else None
    return bool(_inside(np.concatenate(points), other, own).any())


def _points(corners: np.ndarray, touch: float) -> np.ndarray:
    """(N, 3) middles of faces, a little outside; faces without area have none."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    there = np.flatnonzero(length > 0)
    there = there[np.unique(np.linspace(0, len(there) - 1, min(POINTS, len(there))).astype(int))]
    extent = np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0))
    return corners[there].mean(axis=1) + touch * extent * normals[there] / length[there, None]


def _inside(points: np.ndarray, body: _Body, own: Sequence[int] | np.ndarray | None) -> np.ndarray:
    """(N,) bool: points in a body, by most of three rays. own: (N,) pieces of it that each point does not see."""
    low, high = body.bounds
    scale = float(np.ptp(body.bounds, axis=0).max()) or 1.0
    corners, at = (body.corners - (low + high) / 2) / scale, (points - (low + high) / 2) / scale
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    scene = RayScene([(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), 1)])
    votes = np.zeros(len(at), int)
    for way in WAYS:
        ray, face, _ = scene.hits(at, np.broadcast_to(way, at.shape))
        sign = np.sign(normals[face] @ way)
        if own is not None:
            sign = sign * (body.piece[face] != np.asarray(own)[ray])
        votes += np.bincount(ray, weights=sign, minlength=len(at)) > 0
    return votes > len(WAYS) // 2
