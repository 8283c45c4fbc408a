"""A building of one mesh -> its floor, its walls and its ceiling, by how its faces lie."""

from dataclasses import replace

import numpy as np

from dataset_builder.assets.scene_model import Role, SceneThing
from dataset_builder.assets.scene_readers.shape_roles import SIDES, world_mesh
from dataset_builder.digest import digest
from dataset_builder.geometry.edges import unit
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import RayScene

LEVEL = 0.5
"""Least |z| of the normal of a floor, a ceiling or a roof: slopes of 60 degrees."""
HEAD = 1.5
"""Metres of a room's height, at the least."""
OFF = 1e-3
"""Metres from a face where its rays begin."""
BIN, MINOR = 0.25, 0.2
"""Metres of a level, and share of the largest level's area that makes another one a floor: table tops do not."""
PASSAGE = 0.5
"""Metres of width below which a hollow is the inside of a wall."""
ROLES: tuple[Role, ...] = ("floor", "walls", "ceiling")
UP = np.array([0.0, 0.0, 1.0])


def parted(thing: SceneThing) -> tuple[SceneThing, ...]:
    """The thing as `NAME#floor`, `NAME#walls` and `NAME#ceiling`, as far as it has them."""
    roles = face_roles(world_mesh(thing))
    return tuple(replace(thing, name=f"{thing.name}#{role}", role=role, content=digest([thing.content, role]),
                         asset=replace(thing.asset, name=f"{thing.asset.name}#{role}",
                                       mesh=_faces(thing.asset.mesh, roles == number)))
                 for number, role in enumerate(ROLES) if (roles == number).any())


def face_roles(mesh: TriangleMesh) -> np.ndarray:
    """(F,) which of `ROLES` each face of a building has; Z is up.

    A level face with a room's height free to the next face above it is floor, one with that below it is ceiling, but
    for the ends of solid walls. What has the sky above it is roof where there is room below it, else floor. The
    underside of the lowest slab is floor. All else is wall, levels of little area too.
    """
    areas = mesh.area_normals
    level = np.flatnonzero(np.abs(unit(areas)[:, 2]) >= LEVEL)
    size = np.linalg.norm(areas, axis=1) / 2
    middles = mesh.corners[level].mean(axis=1)
    rays = RayScene([(mesh.positions, mesh.faces, 1)])
    above, below = (rays.first_hit(middles + OFF * way, np.repeat(way[None], len(level), axis=0))[1]
                    for way in (UP, -UP))
    sky = ~np.isfinite(above)
    deep = _is_deep(rays, middles, sky)
    floor = (~sky & (above >= HEAD) & _is_wide(rays, middles + UP * HEAD / 3)) | (sky & ~deep) | (
        ~np.isfinite(below) & (above < HEAD))
    ceiling = ~floor & ((np.isfinite(below) & (below >= HEAD)) | deep) & _is_wide(rays, middles - UP * HEAD / 3)
    floor[floor] = _is_storey(middles[floor, 2], size[level[floor]])
    roles = np.ones(len(mesh.faces), np.int64)
    roles[level[floor]], roles[level[ceiling]] = 0, 2
    return roles


def _is_deep(rays: RayScene, points: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """(N,) whether any face lies a room's height or more below a point, of those (N,) that are asked for."""
    deep = np.zeros(len(points), bool)
    if (chosen := np.flatnonzero(asked)).size:
        ray, _, distance = rays.hits(points[chosen] - OFF * UP, np.repeat(-UP[None], len(chosen), axis=0))
        deep[chosen[ray[distance >= HEAD]]] = True
    return deep


def _is_wide(rays: RayScene, points: np.ndarray) -> np.ndarray:
    """(N,) whether there is a passage's width around a point in all directions: inside of a solid wall there is not."""
    free = rays.first_hit(np.repeat(points, len(SIDES), axis=0), np.tile(SIDES, (len(points), 1)))[1]
    free = free.reshape(-1, len(SIDES))
    return np.asarray((free + np.roll(free, len(SIDES) // 2, axis=1)).min(axis=1, initial=np.inf) >= PASSAGE)


def _is_storey(heights: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """(N,) whether faces at these heights are in levels of much area."""
    if not len(heights):
        return np.zeros(0, bool)
    bins = np.floor((heights - heights.min()) / BIN + 0.5).astype(np.int64)
    sums = np.bincount(np.unique(bins, return_inverse=True)[1], weights=areas)
    return (sums >= MINOR * sums.max())[np.unique(bins, return_inverse=True)[1]]


def _faces(mesh: TriangleMesh, kept: np.ndarray) -> TriangleMesh:
    """The mesh with only these faces."""
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    return TriangleMesh(positions=mesh.positions[used], faces=faces.reshape(-1, 3), uvs=mesh.uvs[kept],
                        material=mesh.material[kept], colors=None if mesh.colors is None else mesh.colors[kept])
