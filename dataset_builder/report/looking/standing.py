"""What stands in an arrangement, as coloured triangles: the target, furniture, and the parts of a room."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from dataset_builder.assets.asset import Asset, Material, see_through
from dataset_builder.label.scene_plan import PlacedObject, RoomPlan
from dataset_builder.planning.scene.arrangement import geometry_of
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.room_parts import PartOf, room_parts
from dataset_builder.tonemap import srgb

SWATCH, READ = 16, 256
"""Texels along a side that colours of faces are looked up in, and that are averaged for them."""
WIDE = 0.5
"""Sides of a texture that a face spans from which on it has the texture's mean colour."""
LEVEL = 0.3
"""Vertical part of a face's normal from which on it may be a roof."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingThing:
    """One thing, where it is."""

    name: str
    part: Literal["target"] | PartOf
    category: str
    """What it is, in a word; of a building, the part."""
    positions: np.ndarray
    """(V, 3) in the world, metres."""
    faces: np.ndarray
    """(F, 3) into positions."""
    colours: np.ndarray
    """(F, 3) uint8 sRGB: the base colour there."""
    clear: np.ndarray
    """(F,) which faces let light through."""
    yaw: float | None = None
    """Degrees that it is turned about +Z; None for what no plan has turned."""

    @cached_property
    def box(self) -> np.ndarray:
        """(2, 3) low and high corner."""
        used = self.positions[np.unique(self.faces)]
        return np.stack([used.min(axis=0), used.max(axis=0)])


def standing(room: RoomPlan, target: PlacedObject, furniture: Sequence[PlacedObject],
             mesh_root: Path) -> tuple[StandingThing, ...]:
    """The target, the furniture of a plan, and all that is around. Raises as `asset_of` and `room_parts` do."""
    return tuple([_placed(target, "target", mesh_root), *(_placed(one, "furniture", mesh_root) for one in furniture),
                  *_around(room, mesh_root)])


def _placed(placed: PlacedObject, part: Literal["target", "furniture"], mesh_root: Path) -> StandingThing:
    asset = asset_of(placed.object, mesh_root)
    positions, faces, _ = geometry_of(placed, mesh_root)
    return StandingThing(name=placed.object.name, part=part, category=placed.object.category, positions=positions,
                         faces=faces, colours=face_colours(asset), clear=see_through(asset), yaw=placed.yaw)


def _around(room: RoomPlan, mesh_root: Path) -> Iterator[StandingThing]:
    for part in room_parts(room, mesh_root):
        if len(part.faces):
            category = part.asset.category if part.part == "furniture" else part.part
            yield StandingThing(name=part.name, part=part.part, category=category or "object", clear=part.clear,
                                positions=part.positions, faces=part.faces, colours=face_colours(part.asset))


def face_colours(asset: Asset) -> np.ndarray:
    """(F, 3) uint8 sRGB base colour of faces: the factor, times the texture about the middle of the face, times the
    mean of vertex colours; what glows is at least as bright as that."""
    mesh, linear = asset.mesh, np.ones((len(asset.mesh.faces), 3))
    for index in np.unique(mesh.material).tolist():
        own = mesh.material == index
        material = asset.materials[index]
        linear[own] = np.maximum(np.multiply(material.base_color, _texels(material, mesh.uvs[own])),
                                 np.clip(material.emission, 0, 1))
    if mesh.colors is not None:
        linear *= mesh.colors[..., :3].mean(axis=1)
    return np.rint(255 * srgb(linear)).astype(np.uint8)


def _texels(material: Material, corners: np.ndarray) -> np.ndarray:
    """(N, 3) of the texture, averaged down, amid faces whose corners (N, 3, 2) are in it; the mean of all of it where a
    face shows most of it, 1 without one."""
    if material.texture is None:
        return np.ones((len(corners), 3))
    texels = material.texture.base_color
    step = max(1, max(texels.shape[:2]) // READ)
    texels = texels[::step, ::step].astype(np.float32)
    rows, columns = (np.array_split(np.arange(count), min(SWATCH, count)) for count in texels.shape[:2])
    small = np.array([[texels[np.ix_(row, column)].mean(axis=(0, 1)) for column in columns] for row in rows])
    u, v = np.nan_to_num(corners.mean(axis=1) % 1.0).T
    picked: np.ndarray = small[((1 - v) * len(rows)).astype(int).clip(0, len(rows) - 1),
                               (u * len(columns)).astype(int).clip(0, len(columns) - 1)]
    picked[np.ptp(corners, axis=1).max(axis=1) > WIDE] = small.mean(axis=(0, 1))
    return picked


def roof_above(things: Sequence[StandingThing], points: np.ndarray) -> float:
    """Height of the lowest level face of the building above all `points` (N, 3) and over their first; inf without."""
    x, y, top = *points[0, :2], points[:, 2].max()
    found = np.inf
    for thing in things:
        if thing.part in ("target", "furniture"):
            continue
        corners = thing.positions[thing.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        low, high = corners.min(axis=1), corners.max(axis=1)
        over = (low[:, 2] >= top - 1e-6) & (np.abs(normal[:, 2]) > LEVEL * np.linalg.norm(normal, axis=1))
        over &= ((low[:, :2] <= (x, y)) & (high[:, :2] >= (x, y))).all(axis=1)
        found = min(found, float(low[over, 2].min(initial=np.inf)))
    return found
