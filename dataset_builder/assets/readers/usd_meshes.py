"""A mesh or an implicit shape of USD -> triangles with what lies on their corners."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import GREY, refuse
from dataset_builder.assets.readers.polygon_checks import checked_triangles, crossing
from dataset_builder.assets.readers.polygons import triangulated
from dataset_builder.assets.readers.usd_cages import cage_size, refined
from dataset_builder.assets.readers.usd_inventory import SHAPES
from dataset_builder.assets.readers.usd_shapes import shape_polygons
from dataset_builder.geometry.cages import Round

if TYPE_CHECKING:
    from pxr import Usd


@dataclass(frozen=True, kw_only=True, eq=False)
class UsdMesh:
    """A mesh in its own frame; T triangles over C corners of V vertices, after any refinement."""

    path: Path
    prim: "Usd.Prim"
    name: str
    positions: np.ndarray
    """(V, 3) float64."""
    indices: np.ndarray
    """(C,) into positions."""
    corners: np.ndarray
    """(T, 3) numbers of corners, counter-clockwise from outside."""
    owner: np.ndarray
    """(T,) which polygon of the prim each is from."""
    polygons: tuple[np.ndarray, np.ndarray, int]
    """The prim's own (C',) indices and (F,) counts, and how many vertices it has."""
    rounds: tuple[Round, ...]
    """What these went through."""
    subsets: tuple[tuple["Usd.Prim", np.ndarray], ...]
    """Prims that materials are bound to, with their polygons; every polygon once."""
    decided: tuple[str, ...]
    """What was chosen where the prim leaves a choice, in words."""

    def coordinates(self, name: str) -> np.ndarray | None:
        """(C, 2) texture coordinates of that name, or None."""
        values = self._primvar(name)
        return None if values is None else values[:, :2]

    def colors(self, name: str) -> np.ndarray | None:
        """(C, 4) linear colours of that name, or None."""
        values = self._primvar(name)
        if values is None:
            return None
        rgba = np.ones((len(values), 4), np.float32)
        rgba[:, :3] = np.clip(values[:, :3], 0, 1)
        return rgba

    def color_names(self) -> list[str]:
        """Names of all colours of the mesh that have values."""
        from pxr import Sdf, UsdGeom

        return [str(primvar.GetPrimvarName()) for primvar in UsdGeom.PrimvarsAPI(self.prim).GetPrimvarsWithValues()
                if primvar.GetTypeName().role == Sdf.ValueRoleNames.Color]

    def display_colors(self) -> np.ndarray | None:
        """(C, 4) linear displayColor with displayOpacity as coverage; None where there is neither."""
        rgba, opacity = self.colors("displayColor"), self._primvar("displayOpacity")
        if opacity is not None:
            if rgba is None:
                rgba = np.full((len(self.indices), 4), GREY, np.float32)
            rgba[:, 3] = np.clip(opacity[:, 0], 0, 1)
        return rgba

    def _primvar(self, name: str) -> np.ndarray | None:
        """(C, N) values of a primvar, which may be inherited, at every corner; None where there is none."""
        from pxr import Usd, UsdGeom

        primvar = UsdGeom.PrimvarsAPI(self.prim).FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasValue():
            return None
        at, how = f"{self.name}.{name}", primvar.GetInterpolation()
        values = _numbers(primvar.Get(Usd.TimeCode.EarliestTime()))
        if values is None or (name != "displayOpacity" and values.shape[1] < 2):
            refuse(self.path, "expected numbers, got another type", at=at)
        if primvar.IsIndexed():
            order = np.asarray(primvar.GetIndices(Usd.TimeCode.EarliestTime()), dtype=np.int64).reshape(-1)
            wrong = np.flatnonzero((order < 0) | (order >= len(values)))
            if len(wrong):
                refuse(self.path, f"expected indices in [0, {len(values)}), got {len(wrong)} others, first "
                                  f"{order[wrong[0]]}", at=at)
            values = values[order]
        if not np.isfinite(values).all():
            refuse(self.path, f"expected finite numbers, got {int((~np.isfinite(values)).sum())} NaN or Inf", at=at)
        indices, counts, vertices = self.polygons
        faces = np.repeat(np.arange(len(counts)), counts)
        place = {"constant": np.zeros_like(indices), "uniform": faces, "faceVarying": np.arange(len(indices))}
        expected = {"constant": 1, "uniform": len(counts), "faceVarying": len(indices)}.get(how, vertices)
        if len(values) != expected and not (how == "constant" and len(values) > 1 and values.shape[1] == 1):
            refuse(self.path, f"expected {expected} values, one for each {UNITS.get(how, 'vertex')}, got {len(values)}",
                   at=at)
        if how == "vertex" and self.rounds:
            for each in self.rounds:
                values = each.vertex_values(values)
            return values[self.indices]
        values = values[place.get(how, indices)]
        for each in self.rounds:
            values = each.corner_values(values)
        return values


UNITS = {"constant": "mesh", "uniform": "face", "faceVarying": "corner"}


def _numbers(values: object) -> np.ndarray | None:
    """(N, M) of an array of numbers or vectors, or of a single one."""
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if found.ndim == 2:
        return found
    return found.reshape(-1, 1) if found.ndim == 1 and len(found) and type(values).__name__.endswith("Array") else None


def has_faces(prim: "Usd.Prim") -> bool:
    """Whether a mesh states any polygon, or corners of some. Loose points and edges come as meshes without."""
    from pxr import Usd

    first = Usd.TimeCode.EarliestTime()
    return str(prim.GetTypeName()) in SHAPES or any(
        bool(prim.GetAttribute(name).Get(first)) for name in ("faceVertexCounts", "faceVertexIndices"))


def read_mesh(path: Path, prim: "Usd.Prim", *, rounds: int, most: int) -> UsdMesh:
    """The mesh, or the shape, as triangles; a subdivision surface after some rounds of refinement. Raises UserError
    where it is no surface, or has over `most` triangles."""
    from pxr import Usd

    name, first = str(prim.GetPath()), Usd.TimeCode.EarliestTime()
    if prim.GetTypeName() in SHAPES:
        points, indices, counts = shape_polygons(path, prim)
        holes, rounds = np.zeros(0, np.int64), 0
    else:
        points = np.asarray(prim.GetAttribute("points").Get(first) or np.zeros((0, 3)), np.float64).reshape(-1, 3)
        counts, indices, holes = (np.asarray(prim.GetAttribute(each).Get(first) or (), dtype=np.int64).reshape(-1)
                                  for each in ("faceVertexCounts", "faceVertexIndices", "holeIndices"))
    if counts.min(initial=0) < 0 or counts.sum() != len(indices):
        refuse(path, f"expected faceVertexCounts that sum to the {len(indices)} faceVertexIndices, got "
                     f"{counts.sum()}", at=name)
    if len(indices) > most:
        refuse(path, "expected at most 50 million triangles, instances counted each, got more", at=name)
    kept = ~np.isin(np.arange(len(counts)), holes)
    found = checked_triangles(path, points, indices, counts, at=name, kept=kept)
    positions, corners, owner, decided = points, found.corners, found.owner, crossing(found)
    polygons, ended = (indices, counts, len(points)), indices
    passed: tuple[Round, ...] = ()
    if prim.GetTypeName() not in SHAPES and cage_size(prim):
        surface = refined(path, prim, polygons, kept, rounds=rounds, planar=_is_planar(positions, indices, counts))
        passed, decided = surface.rounds, (*decided, *surface.decided)
        for each in passed:
            positions = each.vertex_values(positions)
        if passed:
            ended = passed[-1].cage.indices
            found = triangulated(positions, ended, passed[-1].cage.counts)
            corners, owner = found.corners, surface.parent[found.owner]
        shown = surface.kept[owner]
        corners, owner = corners[shown], owner[shown]
    if prim.GetAttribute("orientation").Get(first) == "leftHanded":
        corners = corners[:, ::-1]
    return UsdMesh(path=path, prim=prim, name=name, positions=positions, indices=ended, corners=corners, owner=owner,
                   polygons=polygons, rounds=passed, subsets=_subsets(path, prim, len(counts)), decided=decided)


def _is_planar(positions: np.ndarray, indices: np.ndarray, counts: np.ndarray) -> bool:
    """Whether each polygon lies in a plane."""
    if (counts == 3).all():
        return True
    face, firsts = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - counts
    spokes = positions[indices] - positions[indices[firsts]][face]
    after = np.roll(spokes, -1, axis=0)
    normals = np.add.reduceat(np.cross(spokes, after) * (np.diff(face, append=-1) == 0)[:, None], firsts, axis=0)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return bool(np.abs(np.einsum("ij,ij->i", spokes, normals[face])).max() <= 1e-6 * np.abs(spokes).max())


def _subsets(path: Path, prim: "Usd.Prim", faces: int) -> tuple[tuple["Usd.Prim", np.ndarray], ...]:
    """Polygons by the prim that their material is bound to: subsets of the family materialBind, and the mesh itself for
    the rest. Raises UserError for subsets that overlap or name faces which are not there."""
    from pxr import Usd, UsdShade

    owner = np.full(faces, -1)
    prims = [subset.GetPrim() for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()]
    for number, subset in enumerate(prims):
        listed = subset.GetAttribute("indices").Get(Usd.TimeCode.EarliestTime())
        chosen = np.unique(np.asarray(listed or (), dtype=np.int64))
        wrong = chosen[(chosen < 0) | (chosen >= faces)]
        if len(wrong):
            refuse(path, f"expected faces in [0, {faces}), got {len(wrong)} others, first {wrong[0]}",
                   at=str(subset.GetPath()))
        twice = chosen[owner[chosen] >= 0]
        if len(twice):
            refuse(path, f"expected faces that no other subset has, got {len(twice)} that one has, first {twice[0]}",
                   at=str(subset.GetPath()))
        owner[chosen] = number
    return tuple((subset, np.flatnonzero(owner == number)) for number, subset in [(-1, prim),
                                                                                  *enumerate(prims)])
