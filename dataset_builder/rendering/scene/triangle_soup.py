"""The objects of a plan as heaps of triangles with materials: what the renderer is given, still without a renderer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.geometry.edges import corner_normals
from dataset_builder.geometry.mesh import TriangleMesh, joined_colors, transform
from dataset_builder.geometry.rough_base import RoughBase, bounding_radius
from dataset_builder.geometry.rough_steps import base_of, roughened
from dataset_builder.geometry.roughness import measure_roughness
from dataset_builder.label.example_plan import ExamplePlan, RoughPlan
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.planning.scene.assets_of_plan import (
    asset_of,
    thing_of,
    turned_up,
    world_from_object,
    yaw_and_rest,
)
from dataset_builder.planning.scene.recent import Recent
from dataset_builder.planning.scene.room_parts import RoomPart, room_parts
from dataset_builder.seeding import rng

MATT = Material(name="field", base_color=(1.0, 1.0, 1.0), specular=0.0)
"""Of meshes from fields, whose vertices have the colours."""
KEPT_BASES, KEPT_MAPS = 16, 8
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
_known_normals: WeakKeyDictionary[Asset, Recent[np.ndarray]] = WeakKeyDictionary()


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughTwin:
    """A placed R3DM."""

    mesh: TriangleMesh
    """In the object's frame."""
    soup: Soup
    figures: Mapping[str, float]
    """Its measured distance from the 3DM, as `Roughness` names it; of an object that is a field, its `radius` alone."""


def soup_of(mesh: TriangleMesh, normals: np.ndarray, materials: tuple[Material, ...], world: np.ndarray,
            instance: int) -> Soup:
    """The triangles of one object, moved by a rigid (4, 4) `world` transform. normals: (F, 3, 3) in the object's
    frame."""
    rotation, offset = world[:3, :3], world[:3, 3]
    return Soup(corners=mesh.corners @ rotation.T + offset, normals=normals @ rotation.T, uvs=mesh.uvs,
                material=mesh.material, instance=np.full(len(mesh.faces), instance, np.int32),
                part=np.zeros(len(mesh.faces), np.int8), materials=materials, colors=mesh.colors)


def merge(soups: Sequence[Soup]) -> Soup:
    """One soup of several, in order; an empty one of none."""
    if len(soups) == 1:
        return soups[0]
    if not soups:
        return _soup_of_nothing()
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


def _soup_of_nothing() -> Soup:
    corners, whole = np.zeros((0, 3, 3)), np.zeros(0)
    return Soup(corners=corners, normals=corners, uvs=np.zeros((0, 3, 2)), material=whole, instance=whole, part=whole,
                materials=())


def surroundings(plan: ExamplePlan, mesh_root: Path) -> Soup:
    """Everything but the target object."""
    return merge([_room(plan.room, mesh_root), *(clean(placed, mesh_root) for placed in plan.furniture)])


def _room(plan: RoomPlan, mesh_root: Path) -> Soup:
    return _rooms.get((plan, mesh_root), lambda: merge([part_soup(part) for part in room_parts(plan, mesh_root)]))


def part_soup(part: RoomPart) -> Soup:
    """The triangles of what is around; its transform may scale, shear and mirror."""
    mesh, (yaw, rest) = transform(part.asset.mesh, part.world), yaw_and_rest(part.world)
    return Soup(corners=mesh.corners, normals=_normals(part.asset, rest) @ turned_up(yaw).T, uvs=mesh.uvs,
                material=mesh.material, instance=np.full(len(mesh.faces), part.instance),
                part=np.full(len(mesh.faces), PARTS.index(part.part)), materials=part.asset.materials,
                colors=mesh.colors)


def clean(placed: PlacedObject, mesh_root: Path) -> Soup:
    """A placed object as its 3DM."""
    asset = asset_of(placed.object, mesh_root)
    normals = clean_normals(placed.object, mesh_root)
    return soup_of(asset.mesh, normals, asset.materials, world_from_object(placed), placed.instance)


def clean_normals(plan: ObjectPlan, mesh_root: Path) -> np.ndarray:
    """(F, 3, 3) shading normals of an object's 3DM, in its own frame."""
    if plan.kind == "thing":
        # Of the same mesh as where it is no target: of two sums of one angle, one may be a crease
        return _normals(thing_of(plan, mesh_root).asset, np.reshape(plan.linear, (3, 3)))
    return _normals(asset_of(plan, mesh_root), np.eye(3))


def _normals(asset: Asset, linear: np.ndarray) -> np.ndarray:
    """(F, 3, 3) normals of an asset's mesh moved by a (3, 3) map, found anew for each map: creases are where angles are
    sharp after it. Maps that differ by less than 1e-12 of their largest number, or in size, are one."""
    known = _known_normals.setdefault(asset, Recent[np.ndarray](KEPT_MAPS, KEPT_BYTES, lambda normals: normals.nbytes))
    matrix = np.eye(4)
    matrix[:3, :3] = (linear / (np.abs(linear).max() or 1)).round(12) + 0.0
    return known.get(matrix.tobytes(), lambda: corner_normals(
        asset.mesh if np.array_equal(matrix, np.eye(4)) else transform(asset.mesh, matrix)))


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
    return RoughTwin(mesh=mesh, soup=soup, figures=_measured(mesh, asset.mesh, plan))


def field_twin(placed: PlacedObject, plan: RoughPlan, mesh_root: Path, mesh: TriangleMesh | None) -> RoughTwin:
    """The R3DM of a placed object that is taken from a field: matt, in the colours that the field shows. mesh: the
    field's, in the object's frame; None where the object is a field itself, and its mesh the R3DM."""
    asset = asset_of(placed.object, mesh_root)
    rough, materials = (mesh, (MATT,)) if mesh is not None else (asset.mesh, asset.materials)
    soup = soup_of(rough, corner_normals(rough), materials, world_from_object(placed), placed.instance)
    return RoughTwin(mesh=rough, soup=soup, figures={"radius": bounding_radius(rough)} if mesh is None else
                     _measured(rough, asset.mesh, plan))


def _measured(rough: TriangleMesh, clean: TriangleMesh, plan: RoughPlan) -> dict[str, float]:
    return measure_roughness(rough, clean, rng(int(plan.seed), "roughness")).model_dump()


@lru_cache(maxsize=KEPT_BASES)
def _base(plan: ObjectPlan, edge_length: float, rounds: int, crease_angle: float, coarsen: bool, triangles: int,
          mesh_root: Path) -> RoughBase:
    return base_of(asset_of(plan, mesh_root).mesh, edge_length=edge_length, rounds=rounds, crease_angle=crease_angle,
                   coarsen=coarsen, triangles=triangles)
