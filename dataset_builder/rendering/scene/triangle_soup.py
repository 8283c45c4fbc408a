"""The objects of a plan as heaps of triangles with materials: what the renderer is given, still without a renderer."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.geometry.edges import corner_normals, unit
from dataset_builder.geometry.mesh import TriangleMesh, joined_colors
from dataset_builder.geometry.rough_base import RoughBase
from dataset_builder.geometry.rough_steps import base_of, roughened
from dataset_builder.geometry.roughness import Roughness, measure_roughness
from dataset_builder.label.example_plan import ExamplePlan, RoughPlan
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.planning.scene.assets_of_plan import asset_of, world_from_object
from dataset_builder.planning.scene.recent import Recent
from dataset_builder.planning.scene.room_parts import RoomPart, room_parts
from dataset_builder.seeding import rng

KEPT_BASES = 16
KEPT_ROOMS, KEPT_BYTES = 16, 1 << 29
NARROW = {"normals": np.float32, "uvs": np.float32, "material": np.int32, "instance": np.int32, "part": np.int8}
PARTS = ("furniture", "floor", "walls", "ceiling")
"""What a triangle belongs to: an object or thing, or a part of the room."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Soup:
    """F triangles in world space. All but corners are kept as narrow as the device takes them."""

    corners: np.ndarray
    """(F, 3, 3) float64, metres; float32 for what is around, in the frame that it is rendered in."""
    normals: np.ndarray
    """(F, 3, 3) float32 unit vectors."""
    uvs: np.ndarray
    """(F, 3, 2) float32."""
    material: np.ndarray
    """(F,) int32 index into `materials`."""
    instance: np.ndarray
    """(F,) int32 value in the `instance` layer."""
    part: np.ndarray
    """(F,) int8 index into `PARTS` of what may be taken out of a light's way."""
    materials: tuple[Material, ...]
    colors: np.ndarray | None = None
    """(F, 3, 4) linear Rec.709 and coverage that multiply base colour and alpha; None is all ones."""

    def __post_init__(self) -> None:
        for name, dtype in NARROW.items():
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=dtype))

    def without(self, parts: Sequence[str]) -> "Soup":
        """The triangles that belong to none of `parts`; materials stay as they are."""
        return self.only(~np.isin(self.part, [PARTS.index(name) for name in parts]))

    def only(self, keep: np.ndarray) -> "Soup":
        """The triangles for which (F,) `keep` is true; materials stay as they are."""
        return Soup(corners=self.corners[keep], normals=self.normals[keep], uvs=self.uvs[keep],
                    material=self.material[keep], instance=self.instance[keep], part=self.part[keep],
                    materials=self.materials, colors=None if self.colors is None else self.colors[keep])


def _bytes_of(soup: Soup) -> int:
    return sum(getattr(getattr(soup, each.name), "nbytes", 0) for each in fields(soup))


_rooms = Recent[Soup](KEPT_ROOMS, KEPT_BYTES, _bytes_of)
_known_normals: WeakKeyDictionary[Asset, np.ndarray] = WeakKeyDictionary()
_part_normals: WeakKeyDictionary[Asset, np.ndarray] = WeakKeyDictionary()
"""Of what is around, which is most of a house: float32."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughTwin:
    """A placed R3DM."""

    soup: Soup
    roughness: Roughness
    """Its measured distance from the 3DM."""


def soup_of(mesh: TriangleMesh, normals: np.ndarray, materials: tuple[Material, ...], world: np.ndarray,
            instance: int) -> Soup:
    """The triangles of one object, moved by a rigid (4, 4) `world` transform. normals: (F, 3, 3) in the object's
    frame."""
    rotation, offset = world[:3, :3], world[:3, 3]
    return Soup(corners=mesh.corners @ rotation.T + offset, normals=normals @ rotation.T, uvs=mesh.uvs,
                material=mesh.material, instance=np.full(len(mesh.faces), instance, np.int32),
                part=np.zeros(len(mesh.faces), np.int8), materials=materials, colors=mesh.colors)


def merge(soups: Sequence[Soup]) -> Soup:
    """One soup of several, in order."""
    if len(soups) == 1:
        return soups[0]
    firsts = np.cumsum([0, *(len(soup.materials) for soup in soups)])
    return Soup(
        corners=np.concatenate([soup.corners for soup in soups]),
        normals=np.concatenate([soup.normals for soup in soups]),
        uvs=np.concatenate([soup.uvs for soup in soups]),
        material=np.concatenate([soup.material + np.int32(first)
                                 for soup, first in zip(soups, firsts, strict=False)]),
        instance=np.concatenate([soup.instance for soup in soups]),
        part=np.concatenate([soup.part for soup in soups]),
        materials=tuple(material for soup in soups for material in soup.materials),
        colors=joined_colors([(len(soup.corners), soup.colors) for soup in soups]),
    )


def surroundings(plan: ExamplePlan, mesh_root: Path) -> Soup:
    """Everything but the target object."""
    return merge([_room(plan.room, mesh_root), *(clean(placed, mesh_root) for placed in plan.furniture)])


def _room(plan: RoomPlan, mesh_root: Path) -> Soup:
    return _rooms.get((plan, mesh_root), lambda: merge([part_soup(part) for part in room_parts(plan, mesh_root)]))


def part_soup(part: RoomPart) -> Soup:
    """The triangles of what is around; its transform may scale, shear and mirror."""
    if part.asset not in _part_normals:
        _part_normals[part.asset] = corner_normals(part.asset.mesh).astype(np.float32)
    mesh, normals = part.asset.mesh, _part_normals[part.asset]
    linear, offset = part.world[:3, :3], part.world[:3, 3]
    corners = mesh.corners @ linear.T + offset
    order = [0, 2, 1] if np.linalg.det(linear) < 0 else slice(None)
    return Soup(corners=corners[:, order], normals=_turned(normals, linear, corners)[:, order], uvs=mesh.uvs[:, order],
                material=mesh.material, instance=np.full(len(mesh.faces), part.instance, np.int32),
                part=np.full(len(mesh.faces), PARTS.index(part.part), np.int8), materials=part.asset.materials,
                colors=None if mesh.colors is None else mesh.colors[:, order])


def _turned(normals: np.ndarray, linear: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(F, 3, 3) unit normals under a linear map: by its inverse transpose, which its cofactors are but for a factor and
    which a map that flattens has, too. Where these leave nothing, that of the face, whose corners are given; where it
    has no area, +Z."""
    if np.array_equal(linear, np.eye(3)):
        return normals @ linear.T
    a, b, c = linear
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
    if np.linalg.det(linear) < 0:
        cofactors = -cofactors
    turned = unit(normals @ (cofactors / (np.abs(cofactors).max() or 1)).T)
    faces = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))[:, None]
    for fallback in (faces, np.array([0.0, 0, 1])):
        turned = np.where(turned.any(axis=2, keepdims=True), turned, fallback)
    return turned


def clean(placed: PlacedObject, mesh_root: Path) -> Soup:
    """A placed object as its 3DM."""
    asset = asset_of(placed.object, mesh_root)
    normals = clean_normals(placed.object, mesh_root)
    return soup_of(asset.mesh, normals, asset.materials, world_from_object(placed), placed.instance)


def clean_normals(plan: ObjectPlan, mesh_root: Path) -> np.ndarray:
    """(F, 3, 3) shading normals of an object's 3DM, in its own frame."""
    return _normals(asset_of(plan, mesh_root))


def _normals(asset: Asset) -> np.ndarray:
    """The normals of an asset, found once for as long as it is kept."""
    if asset not in _known_normals:
        _known_normals[asset] = corner_normals(asset.mesh)
    return _known_normals[asset]


def rough_twin(placed: PlacedObject, plan: RoughPlan, mesh_root: Path) -> RoughTwin:
    """The R3DM of a placed object: its 3DM, subdivided once, and made rough as a noise level has it.

    Shading normals follow the rough surface and break at the 3DM's creases.
    """
    asset = asset_of(placed.object, mesh_root)
    base = _base(placed.object, plan.edge_length, plan.rounds, plan.crease_angle, plan.coarsen, plan.triangles,
                 mesh_root)
    rough = roughened(base, asset.mesh, plan)
    mesh, normals = rough.mesh, corner_normals(rough.mesh, creases=rough.creases)
    soup = soup_of(mesh, normals, asset.materials, world_from_object(placed), placed.instance)
    return RoughTwin(soup=soup, roughness=measure_roughness(mesh, asset.mesh, rng(int(plan.seed), "roughness")))


@lru_cache(maxsize=KEPT_BASES)
def _base(plan: ObjectPlan, edge_length: float, rounds: int, crease_angle: float, coarsen: bool, triangles: int,
          mesh_root: Path) -> RoughBase:
    return base_of(asset_of(plan, mesh_root).mesh, edge_length=edge_length, rounds=rounds, crease_angle=crease_angle,
                   coarsen=coarsen, triangles=triangles)
