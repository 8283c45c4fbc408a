"""The materials of a scene that some face has, with the figures that decide about effects."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.glass_kinds import roughness_range
from dataset_builder.geometry.edges import consistent, dihedral_angles, edges_of
from dataset_builder.geometry.normals import CREASE_ANGLE
from dataset_builder.label.scene_plan import PlacedObject, RoomPlan
from dataset_builder.planning.effects.albedo import scattered_share
from dataset_builder.planning.scene.assets_of_plan import asset_of, room_parts

SMOOTH = 0.0316
"""Roughness below which glass sends light in single directions: GGX alpha of 1e-3, as rendering has it."""
FLAT = 0.01
"""Degrees below which two faces are in one plane."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialUse:
    """One material that at least one face shows.

    owner: name of the object, or of the part of the room. part: `furniture`, or a part of the room. scattered: largest
    share of light that it scatters, see `albedo.scattered_share`. smoothest, roughest: least and largest roughness over
    its texels.
    """

    owner: str
    part: str
    material: Material
    scattered: float
    smoothest: float
    roughest: float

    @property
    def name(self) -> str:
        """As reasons name it: `top: oak of train-table-00`."""
        return f"{self.material.name} of {self.owner if self.part == 'furniture' else f'the {self.part}'}"


def is_smooth(roughness: float) -> bool:
    """Whether glass of a roughness has no lobe of any width."""
    return roughness <= SMOOTH


@dataclass(frozen=True, kw_only=True, eq=False)
class _Facts:
    """What one asset shows. figures: of each material, what it scatters, its least and its largest roughness; smooth:
    whether normals bend."""

    materials: tuple[Material, ...]
    figures: tuple[tuple[float, float, float], ...]
    smooth: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneUse:
    """All that stands in a scene. smooth: names of things whose shading normals are smooth; flat: of all others.
    left_out: what their files say and no effect here simulates."""

    materials: tuple[MaterialUse, ...]
    smooth: tuple[str, ...]
    flat: tuple[str, ...]
    left_out: tuple[str, ...]


_known: WeakKeyDictionary[Asset, _Facts] = WeakKeyDictionary()


def _facts(asset: Asset) -> _Facts:
    """The facts of an asset, found once for as long as it is kept."""
    if asset not in _known:
        shown = tuple(asset.materials[index] for index in np.unique(asset.mesh.material))
        _known[asset] = _Facts(materials=shown, smooth=_is_smooth(asset), figures=tuple(
            (scattered_share(material), *roughness_range(material)) for material in shown))
    return _known[asset]


def _is_smooth(asset: Asset) -> bool:
    """Whether any two faces that share their normals lie in different planes; see `geometry.normals`."""
    edges = edges_of(asset.mesh.faces)
    angle = dihedral_angles(asset.mesh, edges)
    return bool(((angle > FLAT) & (angle <= CREASE_ANGLE) & consistent(edges)).any())


def scene_use(room: RoomPlan, objects: Iterable[PlacedObject], mesh_root: Path) -> SceneUse:
    """What a room and the objects in it show. Raises PlanError where a mesh file is not the one that was planned."""
    things = [(name, name, asset) for name, asset in room_parts(room).items()]
    things += [(placed.object.name, "furniture", asset_of(placed.object, mesh_root)) for placed in objects]
    uses = [MaterialUse(owner=owner, part=part, material=material, scattered=scattered, smoothest=least, roughest=most)
            for owner, part, asset in things
            for material, (scattered, least, most) in zip(_facts(asset).materials, _facts(asset).figures, strict=True)]
    return SceneUse(materials=tuple(uses),
                    smooth=tuple(owner for owner, _, asset in things if _facts(asset).smooth),
                    flat=tuple(owner for owner, _, asset in things if not _facts(asset).smooth),
                    left_out=tuple(asset.meta["left_out"] for _, _, asset in things if asset.meta.get("left_out")))
