"""USD: every mesh prim of a stage, in metres and with y up, through OpenUSD.

https://openusd.org/release/api/class_usd_geom_mesh.html
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import FileModel, FilePart, counted, refuse
from dataset_builder.assets.readers.usd_inventory import inventory, stage_settings
from dataset_builder.assets.readers.usd_materials import UsdMaterial, read_preview_surface
from dataset_builder.assets.readers.usd_meshes import UsdMesh, has_faces, read_mesh
from dataset_builder.extras import missing_named
from dataset_builder.spec.usd_references import diagnostics, said, usd_files
from dataset_builder.spec.usd_trial import trial_problem

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom, UsdShade

MOST_PRIMS = 200_000
MOST_TRIANGLES = 50_000_000
"""Of a stage: instances of instances make any number of few bytes."""


@dataclass(kw_only=True, eq=False)
class _Taken:
    """What has been taken of a stage so far."""

    path: Path
    max_texture: int
    parts: list[FilePart] = field(default_factory=list)
    materials: list[UsdMaterial] = field(default_factory=list)
    known: dict[str, int] = field(default_factory=dict)
    """Index of a material by the path of its prim; -1 for what has no preview surface."""
    left_out: Counter[str] = field(default_factory=Counter)
    decided: dict[str, None] = field(default_factory=dict)
    """What was chosen where the stage leaves a choice, in words, each once."""
    coordinates: list[str] = field(default_factory=list)
    """Names of texture coordinates, by the number of their set."""
    roots: dict[str, None] = field(default_factory=dict)
    prims: int = 0
    triangles: int = 0


def read(path: Path, max_texture: int) -> FileModel:
    """All meshes of a stage. Raises UserError where the file cannot be read, for meshes that are no surface, and
    without usd-core."""
    with missing_named():
        from pxr import Tf
    try:
        files = usd_files(path)
        if problem := trial_problem(str(path), files.layer_bytes, path.stat().st_mtime_ns, "stage"):
            raise ValueError(said(problem))
        with diagnostics():
            return _read(path, max_texture, files.passed_over)
    except Tf.ErrorException as error:
        refuse(path, f"expected a readable {path.suffix} file, got: {said(str(error))}")
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        refuse(path, f"expected a readable {path.suffix} file, got: {error}")


def _read(path: Path, max_texture: int, passed_over: tuple[str, ...]) -> FileModel:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path), Usd.Stage.LoadAll)
    taken = _Taken(path=path, max_texture=max_texture)
    metres, decided = stage_settings(path, stage)
    places = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    for mesh in _meshes(stage, taken):
        matrix = metres @ np.array(places.GetLocalToWorldTransform(mesh.GetPrim())).T
        _take(taken, mesh, matrix)
        taken.roots[str(mesh.GetPath().GetPrefixes()[0])] = None
    lost = tuple(f"{many} {what}" if many > 1 else what for what, many in taken.left_out.items())
    if not taken.prims:
        refuse(path, f"expected mesh prims, got {', '.join(lost) or 'none'}")
    if len(taken.roots) > 1:
        decided.append(f"meshes of {len(taken.roots)} root prims, whatever defaultPrim says")
    return FileModel(
        parts=tuple(taken.parts), materials=tuple(each.file for each in taken.materials),
        contains=", ".join((counted(taken.prims, "mesh prim"), counted(taken.triangles, "triangle"),
                            counted(len(taken.materials), "material"))),
        left_out=(*lost, *(f"reference to {name}" for name in passed_over), *decided, *taken.decided))


def _meshes(stage: "Usd.Stage", taken: _Taken) -> Iterator["UsdGeom.Mesh"]:
    """Meshes that are drawn; all else is counted in what is left out."""
    from pxr import Usd, UsdGeom

    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    walk = iter(prims)
    for number, prim in enumerate(walk):
        if number > MOST_PRIMS:
            refuse(taken.path, f"expected at most {MOST_PRIMS} prims, instances counted each, got more")
        kept, lost, chosen = inventory(prim)
        taken.left_out.update(lost)
        taken.decided |= dict.fromkeys(chosen)
        if not kept:
            walk.PruneChildren()
        elif prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(prim)
            if has_faces(mesh):
                yield mesh
            else:
                taken.left_out[f"mesh {prim.GetPath()}, which has no faces"] += 1


def _take(taken: _Taken, prim: "UsdGeom.Mesh", matrix: np.ndarray) -> None:
    """Add the parts of a mesh: one for each of its materials."""
    mesh = read_mesh(taken.path, prim, matrix, most=MOST_TRIANGLES - taken.triangles)
    taken.prims += 1
    taken.triangles += len(mesh.corners)
    taken.decided |= dict.fromkeys(mesh.decided)
    bound: dict[int, list[np.ndarray]] = {}
    for shade, faces in mesh.subsets:
        bound.setdefault(_material(taken, shade), []).append(faces)
    read = {"displayColor", *(taken.materials[index].colors for index in bound if index >= 0)}
    taken.left_out.update(f"colours {name}, which no material reads" for name in mesh.color_names() if name not in read)
    for index, sets in bound.items():
        chosen = np.isin(mesh.owner, np.concatenate(sets))
        if chosen.any():
            taken.parts.append(_part(taken, mesh, index, chosen))


def _part(taken: _Taken, mesh: UsdMesh, index: int, chosen: np.ndarray) -> FilePart:
    """The (T,) chosen triangles of a mesh with one material."""
    material = taken.materials[index] if index >= 0 else None
    corners = mesh.corners[chosen]
    uvs, colors = {}, None
    if material is None:
        colors = mesh.display_colors()
    else:
        if material.file.material.texture is not None:
            coordinates = mesh.coordinates(material.coordinates)
            if coordinates is None:
                taken.left_out[f"textures of {material.file.material.name} on a mesh without texture coordinates "
                               f"{material.coordinates}"] += 1
            else:
                uvs = {material.file.uv_set: coordinates[corners]}
                if material.black and not ((coordinates >= 0) & (coordinates <= 1)).all():
                    taken.left_out[f"black beyond the edges of textures of {material.file.material.name}"] += 1
        if material.colors and (colors := mesh.colors(material.colors)) is None:
            taken.left_out[f"colours {material.colors}, which a mesh does not have"] += 1
    return FilePart(name=mesh.name, positions=mesh.positions, faces=mesh.indices[corners], material=index, uvs=uvs,
                    colors=None if colors is None else colors[corners])


def _material(taken: _Taken, prim: "Usd.Prim") -> int:
    """Index of the material that is bound to a prim; -1 for none, or none that is read."""
    from pxr import UsdShade

    unread = None
    for purpose in (UsdShade.Tokens.full, UsdShade.Tokens.preview):
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
        if not material:
            continue
        if (where := str(material.GetPath())) in taken.known:
            return taken.known[where]
        surface = material.ComputeSurfaceSource()[0]
        if surface and surface.GetIdAttr().Get() == "UsdPreviewSurface":
            return _add(taken, material, surface)
        unread = unread or material
    if unread:
        taken.known[str(unread.GetPath())] = -1
        taken.left_out[f"material {unread.GetPrim().GetName()}, which has no UsdPreviewSurface; displayColor is taken "
                       "for it"] += 1
    return -1


def _add(taken: _Taken, material: "UsdShade.Material", surface: "UsdShade.Shader") -> int:
    """Index of a material that is new."""
    names = {each.file.material.name for each in taken.materials}
    name = material.GetPrim().GetName()
    made = read_preview_surface(taken.path, surface, name if name not in names else str(material.GetPath()),
                                taken.max_texture)
    if made.coordinates not in taken.coordinates:
        taken.coordinates.append(made.coordinates)
    file = replace(made.file, uv_set=taken.coordinates.index(made.coordinates))
    taken.materials.append(replace(made, file=file))
    taken.known[str(material.GetPath())] = len(taken.materials) - 1
    return len(taken.materials) - 1
