"""How the fields of a split are made: every number drawn once per object, whatever scene it stands in."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset, range_of
from dataset_builder.label.field_plan import NO_FIELD, FieldPlan
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan, ObjectPlan, Vector
from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.scene.assets_of_plan import turned_up
from dataset_builder.planning.view.lights import source_light
from dataset_builder.seeding import derive_seed, rng
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.field import FieldSpec
from dataset_builder.spec.mesh_source import names_field

OWN = FieldPlan(kind="own")
IMAGE_DEPTH = 8
"""Longest path of the images that fields are fitted to, in edges: an object alone under an open sky."""

GLASS = 0.05
"""Share of the surface, weighted by transmission, above which an object is said to be of glass."""
ABOUT_FIELDS = "field: "
"""What notes about fields begin with."""


def is_own(plan: ObjectPlan) -> bool:
    """Whether an object is a field already, such as a capture."""
    return plan.kind == "file" and names_field(plan.source)


def field_plan(spec: DatasetSpec, asked: FieldSpec | None, pair: PairRef, target: ObjectPlan, root: Path) -> FieldPlan:
    """The field of a pair's object that a spec asks for: `OWN` where the object is one. None asks for none.

    The seed and the light, a sun's place included, are the object's: views, scenes and kinds of field share them.
    Raises PlanError where the image of the sky cannot be read.
    """
    if is_own(target):
        return OWN
    if asked is None:
        return NO_FIELD
    whose = ("scene", pair.scene) if target.kind == "thing" else ()
    path = (pair.split, *whose, "object", pair.object, "field")
    light = source_light(spec.source, partial(rng, spec.seed, *path, "source"), root)
    return FieldPlan(kind=asked.field, views=asked.views, held_out=asked.held_out, size=asked.size, spp=asked.spp,
                     resolution=asked.resolution, steps=asked.steps, max_depth=IMAGE_DEPTH,
                     seed=str(derive_seed(spec.seed, *path)), light=light.model_copy(update={"open": ()}))


def field_notes(fields: Iterable[FieldPlan], asset: Asset) -> tuple[str, ...]:
    """What a reader of a plan should know about its fields: one cannot show what is seen through glass, which moves
    with the camera."""
    if not any(field.made for field in fields):
        return ()
    areas = np.bincount(asset.mesh.material, np.linalg.norm(asset.mesh.area_normals, axis=1),
                        minlength=len(asset.materials))
    share = float(areas @ [range_of(material, "transmission")[1] for material in asset.materials] / areas.sum())
    return () if share <= GLASS else (
        f"{ABOUT_FIELDS}{share:.0%} of the surface is glass, which a field cannot show: what is seen through it moves "
        "with the camera; it may well fail its gates",)


def in_world(light: IlluminationPlan, yaw: float, opened: tuple[str, ...]) -> IlluminationPlan:
    """The light of a field where its object stands turned by `yaw` degrees: what the clean mesh would have to be lit
    by for the same image. opened: room parts that are out of its way."""
    return IlluminationPlan(lights=tuple(_turned(each, yaw) for each in light.lights), open=opened)


def _turned(light: LightPlan, yaw: float) -> LightPlan:
    direction: Vector = tuple((turned_up(yaw) @ np.array(light.direction)).tolist())
    return light.model_copy(update={"direction": direction, "turn": light.turn + yaw if light.image else light.turn})
