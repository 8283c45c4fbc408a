"""The plan of an example -> the things that its stage has as prims, each with its triangles in a frame of its own."""

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.scene.assets_of_plan import world_from_object
from dataset_builder.planning.scene.room_parts import ROOM_INSTANCE
from dataset_builder.rendering.scene.triangle_soup import PARTS, Soup, clean, field_twin, rough_twin, surroundings
from dataset_builder.spec.licences import FREE


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedThing:
    """What becomes a prim: a piece of furniture, or a part of the building."""

    name: str
    """As the plan has it."""
    category: str
    licence: str
    instance: int
    """Value in the `instance` layer."""
    part: str
    """`floor`, `walls` or `ceiling`; empty for furniture."""
    world: np.ndarray
    """(4, 4) rigid world_from_thing."""
    soup: Soup
    """In the frame of the thing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StageContents:
    """All geometry of an example."""

    target: PlacedThing
    """The 3DM."""
    rough: Soup
    """The R3DM, in the frame of the target."""
    around: tuple[PlacedThing, ...]
    """Parts of the building, then furniture."""

    @property
    def materials(self) -> tuple[Material, ...]:
        """Those that faces have, each once, in order."""
        soups = (self.target.soup, self.rough, *(thing.soup for thing in self.around))
        used = [soup.materials[index] for soup in soups for index in np.unique(soup.material)]
        return tuple({id(material): material for material in used}.values())


def stage_contents(plan: ExamplePlan, mesh_root: Path, taken: TriangleMesh | None = None) -> StageContents:
    """Everything that the passes of an example see, by the functions that render it. taken: the field's mesh, where the
    R3DM is taken from one that is not the object itself.

    Raises PlanError where a file that the plan names is not the one that was planned.
    """
    target = clean(plan.target, mesh_root)
    twin = (rough_twin(plan.target, plan.rough, mesh_root) if not plan.rough.field.there else
            field_twin(plan.target, plan.rough, mesh_root, taken))
    world = world_from_object(plan.target)
    return StageContents(target=_object(plan.target, target), rough=_moved(twin.soup, world),
                         around=tuple(_around(plan, surroundings(plan, mesh_root))))


def _around(plan: ExamplePlan, soup: Soup) -> list[PlacedThing]:
    """The surroundings, taken apart by part of the building and by instance."""
    building = []
    for index, part in enumerate(PARTS):
        faces = (soup.part == index) & ((soup.instance == ROOM_INSTANCE) | (part != "furniture"))
        if faces.any():
            name = "rest" if part == "furniture" else part
            licence = plan.room.scene.file.licence or FREE
            building.append(PlacedThing(name=name, category=name, licence=licence, instance=ROOM_INSTANCE, part=name,
                                        world=np.eye(4), soup=soup.only(faces)))
    furniture = [_object(placed, soup.only(soup.instance == placed.instance)) for placed in plan.furniture]
    for thing in plan.room.scene.things:
        own = soup.only(soup.instance == thing.instance)
        world = np.eye(4)
        world[:3, 3] = _base(own.corners)
        furniture.append(PlacedThing(name=thing.name, category=thing.category, licence=thing.licence, part="",
                                     instance=thing.instance, world=world, soup=_moved(own, world)))
    return [*building, *sorted(furniture, key=lambda thing: thing.instance)]


def _object(placed: PlacedObject, soup: Soup) -> PlacedThing:
    plan: ObjectPlan = placed.object
    world = world_from_object(placed)
    return PlacedThing(name=plan.name, category=plan.category, licence=plan.licence, instance=placed.instance, part="",
                       world=world, soup=_moved(soup, world))


def _base(corners: np.ndarray) -> np.ndarray:
    """(3,) the point of the floor below the middle of a thing's box."""
    points = corners.reshape(-1, 3)
    if not len(points):
        return np.zeros(3)
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([*(low + high)[:2] / 2, low[2]])


def _moved(soup: Soup, world: np.ndarray) -> Soup:
    """The soup in the frame that a rigid (4, 4) matrix brings to the world."""
    turn = world[:3, :3]
    return Soup(corners=(soup.corners - world[:3, 3]) @ turn, normals=soup.normals @ turn, uvs=soup.uvs,
                material=soup.material, instance=soup.instance, part=soup.part, materials=soup.materials,
                colors=soup.colors)


def prim_name(name: str, taken: Collection[str] = ()) -> str:
    """A name that a prim may have, made of any text, and none of those that are taken.

    >>> prim_name("train-chair-03"), prim_name("2 legs", {"_2_legs"})
    ('train_chair_03', '_2_legs_1')
    """
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "thing"
    plain = f"_{plain}" if plain[0].isdigit() else plain
    number, found = 0, plain
    while found in taken:
        number += 1
        found = f"{plain}_{number}"
    return found
