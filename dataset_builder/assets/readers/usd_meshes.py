"""A mesh prim of USD -> triangles with what lies on their corners."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import GREY, refuse
from dataset_builder.assets.readers.polygon_checks import checked_triangles, crossing

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom


@dataclass(frozen=True, kw_only=True, eq=False)
class UsdMesh:
    """A mesh where the stage puts it; C corners of all its polygons, T triangles."""

    path: Path
    prim: "UsdGeom.Mesh"
    name: str
    positions: np.ndarray
    """(V, 3) float64."""
    indices: np.ndarray
    """(C,) into positions."""
    counts: np.ndarray
    """(F,) corners of each polygon."""
    corners: np.ndarray
    """(T, 3) numbers of corners, counter-clockwise from outside."""
    owner: np.ndarray
    """(T,) which polygon each is from."""
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
        faces = np.repeat(np.arange(len(self.counts)), self.counts)
        place = {"constant": np.zeros_like(self.indices), "uniform": faces, "faceVarying": np.arange(len(self.indices))}
        expected = {"constant": 1, "uniform": len(self.counts), "faceVarying": len(self.indices)}.get(
            how, len(self.positions))
        if len(values) != expected and not (how == "constant" and len(values) > 1 and values.shape[1] == 1):
            refuse(self.path, f"expected {expected} values, one for each {UNITS.get(how, 'vertex')}, got {len(values)}",
                   at=at)
        return values[place.get(how, self.indices)]


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


def has_faces(prim: "UsdGeom.Mesh") -> bool:
    """Whether a mesh states any polygon, or corners of some. Loose points and edges come as meshes without."""
    from pxr import Usd

    first = Usd.TimeCode.EarliestTime()
    return bool(prim.GetFaceVertexCountsAttr().Get(first) or prim.GetFaceVertexIndicesAttr().Get(first))


def read_mesh(path: Path, prim: "UsdGeom.Mesh", matrix: np.ndarray, *, most: int) -> UsdMesh:
    """The mesh, moved by a (4, 4) matrix. Raises UserError where it is no surface, or has over `most` triangles."""
    from pxr import Usd

    name, first = str(prim.GetPath()), Usd.TimeCode.EarliestTime()
    points = np.asarray(prim.GetPointsAttr().Get(first) or np.zeros((0, 3)), dtype=np.float64).reshape(-1, 3)
    counts = np.asarray(prim.GetFaceVertexCountsAttr().Get(first) or (), dtype=np.int64)
    indices = np.asarray(prim.GetFaceVertexIndicesAttr().Get(first) or (), dtype=np.int64)
    if counts.min(initial=0) < 0 or counts.sum() != len(indices):
        refuse(path, f"expected faceVertexCounts that sum to the {len(indices)} faceVertexIndices, got "
                     f"{counts.sum()}", at=name)
    if len(indices) > most:
        refuse(path, "expected at most 50 million triangles, instances counted each, got more", at=name)
    positions = points @ matrix[:3, :3].T + matrix[:3, 3]
    holes = np.asarray(prim.GetHoleIndicesAttr().Get(first) or (), dtype=np.int64)
    kept = ~np.isin(np.arange(len(counts)), holes)
    found = checked_triangles(path, positions, indices, counts, at=name, kept=kept)
    left_handed = prim.GetOrientationAttr().Get(first) == "leftHanded"
    turned = left_handed != (np.linalg.det(matrix[:3, :3]) < 0)
    scheme = prim.GetSubdivisionSchemeAttr().Get(first) or "catmullClark"
    cage = [] if scheme == "none" else [f"subdivision surfaces ({scheme}) taken as their control cages"]
    return UsdMesh(path=path, prim=prim, name=name, positions=positions, indices=indices, counts=counts,
                   corners=found.corners[:, ::-1] if turned else found.corners, owner=found.owner,
                   subsets=_subsets(path, prim, len(counts)), decided=(*cage, *crossing(found)))


def _subsets(path: Path, prim: "UsdGeom.Mesh", faces: int) -> tuple[tuple["Usd.Prim", np.ndarray], ...]:
    """Polygons by the prim that their material is bound to: subsets of the family materialBind, and the mesh itself for
    the rest. Raises UserError for subsets that overlap or name faces which are not there."""
    from pxr import Usd, UsdShade

    owner = np.full(faces, -1)
    prims = [subset.GetPrim() for subset in UsdShade.MaterialBindingAPI(prim.GetPrim()).GetMaterialBindSubsets()]
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
    return tuple((subset, np.flatnonzero(owner == number)) for number, subset in [(-1, prim.GetPrim()),
                                                                                  *enumerate(prims)])
