"""Meshes and materials of a 3D-FRONT scene: walls, floors, windows and whatever else the file holds itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dataset_builder.assets.scene_readers.front3d_values import FURTHEST, FaultNotes, LongList, cleaned, number
from dataset_builder.spec.front3d_references import texture_ids
from dataset_builder.spec.problems import shown

NONE = LongList(np.zeros(0), 0)


@dataclass(frozen=True, eq=False)
class FrontMesh:
    """A mesh, in place."""

    uid: str
    kind: str
    """Its type without blanks around it: `WallInner`."""
    positions: np.ndarray
    """(V, 3) float64."""
    faces: np.ndarray
    """(F, 3) int64, counter-clockwise from the side that faces a room."""
    uvs: np.ndarray | None
    """(V, 2), (0, 0) at the lower left corner of an image; None where the file has none."""
    material: str
    """uid; empty for none."""


@dataclass(frozen=True)
class FrontMaterial:
    """A material."""

    uid: str
    textures: tuple[str, ...]
    """Folders that may hold its texture, the first that exists counts."""
    color: tuple[float, float, float, float]
    """sRGB-encoded, and coverage, in [0, 1]."""
    uv_linear: tuple[tuple[float, float], tuple[float, float]] | None
    """Maps texture coordinates; None for no change."""
    normal_map: bool
    """Whether the file names an image of normals, which is not read."""


def mesh_of(notes: FaultNotes, where: str, entry: Mapping[str, Any]) -> FrontMesh:
    """A mesh without the faces that are broken; they are noted."""
    uid, kind = cleaned(entry.get("uid")), cleaned(entry.get("type"))
    lists = {key: value if isinstance(value := entry.get(key), LongList) else NONE for key in ("xyz", "faces", "uv")}
    if not kind:
        notes.add("meshes without a type", where, uid)
    if written := [key for key, each in lists.items() if each.texts]:
        notes.add("numbers written as text, read", where, ", ".join(written))
    positions = _rows(notes, where, "xyz", lists["xyz"].values, 3)
    positions = np.where(np.abs(positions) < FURTHEST, positions, np.nan)
    faces = _good_faces(notes, where, positions, _rows(notes, where, "faces", lists["faces"].values, 3))
    uvs = _uvs(notes, where, lists["uv"].values, len(positions)) if len(faces) else None
    if not len(faces):
        notes.add("meshes without faces, left out", where, f"{uid} {kind}".strip())
    return FrontMesh(uid=uid, kind=kind, positions=np.nan_to_num(positions), faces=faces, uvs=uvs,
                     material=cleaned(entry.get("material")))


def _rows(notes: FaultNotes, where: str, key: str, values: np.ndarray, width: int) -> np.ndarray:
    """(N, width); what is over goes."""
    if over := len(values) % width:
        notes.add("lists that end within a row, cut", where, f"{key} has {len(values):,} numbers")
    return values[:len(values) - over].reshape(-1, width)


def _good_faces(notes: FaultNotes, where: str, positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Those whose corners are there and are numbers."""
    there = ((faces >= 0) & (faces < len(positions)) & (faces == np.floor(faces))).all(axis=1)
    if not there.all():
        notes.add("faces with corners that are not there, left out", where, f"{(~there).sum():,} of {len(faces):,}")
    faces = faces[there].astype(np.int64)
    finite = np.isfinite(positions).all(axis=1)[faces].all(axis=1)
    if not finite.all():
        notes.add("faces with corners that are no numbers, left out", where, f"{(~finite).sum():,} of {len(faces):,}")
    return faces[finite]


def _uvs(notes: FaultNotes, where: str, values: np.ndarray, count: int) -> np.ndarray | None:
    good = np.isfinite(values) & (np.abs(values) < 1e6)
    if len(values) != 2 * count or not good.any():
        notes.add("meshes without texture coordinates, which take one texel", where,
                  f"{len(values):,} numbers for {count:,} vertices")
        return None
    if not good.all():
        notes.add("texture coordinates that are no numbers, taken for 0", where, f"{(~good).sum():,}")
    return np.where(good, values, 0.0).reshape(-1, 2)


def material_of(notes: FaultNotes, where: str, entry: Mapping[str, Any]) -> FrontMaterial:
    """A material; without a colour it is white."""
    color = _numbers(entry.get("color"))
    if len(color) not in (3, 4) or not np.isfinite(color).all():
        notes.add("materials without a colour, taken for white", where, shown(entry.get("color")))
        color = np.full(4, 255.0)
    if ((color < 0) | (color > 255)).any():
        notes.add("colours beyond 0 to 255, clipped", where, shown(color.tolist()))
    red, green, blue, alpha = (np.append(color, 255.0)[:4].clip(0, 255) / 255).tolist()
    return FrontMaterial(uid=cleaned(entry.get("uid")), textures=texture_ids(dict(entry)),
                         color=(red, green, blue, alpha), normal_map=bool(entry.get("normaltexture")),
                         uv_linear=_linear(notes, where, entry.get("UVTransform")))


def _linear(notes: FaultNotes, where: str, value: Any) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """The upper left 2x2 of a 3x3: the data set's tools apply nothing else of it."""
    if value is None:
        return None
    found = _numbers(value)
    if len(found) != 9 or not (np.abs(found) < 1e6).all():
        notes.add("texture transforms that are none, left out", where, shown(value))
        return None
    (a, b), (c, d) = found.reshape(3, 3)[:2, :2].tolist()
    return None if (a, b, c, d) == (1, 0, 0, 1) else ((a, b), (c, d))


def _numbers(value: Any) -> np.ndarray:
    """(N,) of a list, or of a list of lists."""
    rows = value[:16] if isinstance(value, list) else []
    flat = [each for row in rows for each in (row[:16] if isinstance(row, list) else [row])]
    return np.array([number(each) for each in flat], dtype=np.float64)
