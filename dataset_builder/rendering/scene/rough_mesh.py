"""The R3DM of a plan: subdivide the 3DM once, displace it for every noise level, and measure how rough it became."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from dataset_builder.geometry.edges import corner_normals
from dataset_builder.geometry.rough_base import (
    RoughBase,
    Roughness,
    bounding_radius,
    displace,
    measure_roughness,
    rough_base,
)
from dataset_builder.label.example_plan import RoughPlan
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.scene.assets_of_plan import asset_of, world_from_object
from dataset_builder.rendering.scene.triangle_soup import Soup, soup_of
from dataset_builder.seeding import rng

KEPT_BASES = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughTwin:
    """A placed R3DM, and its measured distance from the 3DM."""

    soup: Soup
    roughness: Roughness


def rough_twin(placed: PlacedObject, plan: RoughPlan, mesh_root: Path) -> RoughTwin:
    """The rough twin of a placed object; shading normals follow the displaced surface and break at the 3DM's
    creases."""
    asset = asset_of(placed.object, mesh_root)
    base = _base(placed.object, plan.edge_length, plan.rounds, plan.crease_angle, mesh_root)
    mesh = displace(base.mesh, sigma=plan.sigma, radius=bounding_radius(asset.mesh), direction=plan.direction,
                    rng=rng(int(plan.seed), "vertex noise"))
    normals = corner_normals(mesh, creases=base.creases)
    soup = soup_of(mesh, normals, asset.materials, world_from_object(placed), placed.instance)
    return RoughTwin(soup=soup, roughness=measure_roughness(mesh, asset.mesh, at="vertices"))


@lru_cache(maxsize=KEPT_BASES)
def _base(plan: ObjectPlan, edge_length: float, rounds: int, crease_angle: float, mesh_root: Path) -> RoughBase:
    asset = asset_of(plan, mesh_root)
    return rough_base(asset.mesh, edge_length=edge_length, rounds=rounds, crease_angle=crease_angle)
