"""Meshes and shapes of a USD stage -> parts with materials, each made once and moved to where it stands."""

from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import FilePart, refuse
from dataset_builder.assets.readers.polygon_checks import FARTHEST
from dataset_builder.assets.readers.usd_materials import UsdMaterial, read_preview_surface
from dataset_builder.assets.readers.usd_meshes import UsdMesh, read_mesh
from dataset_builder.assets.readers.usd_stage import OpenStage, naming

if TYPE_CHECKING:
    from pxr import Usd, UsdShade

MOST_TRIANGLES = 50_000_000
"""Of a stage: instances of instances make any number of few bytes."""


@dataclass(kw_only=True, eq=False)
class UsdParts:
    """What has been taken of a stage so far."""

    opened: OpenStage
    max_texture: int
    left_out: Counter[str]
    decided: dict[str, None]
    """What was chosen where the stage leaves a choice, in words, each once."""
    materials: list[UsdMaterial] = field(default_factory=list)
    known: dict[str, int] = field(default_factory=dict)
    """Index of a material by the path of its prim; -1 for what has no preview surface."""
    coordinates: list[str] = field(default_factory=list)
    """Names of texture coordinates, by the number of their set."""
    made: dict[tuple[object, ...], tuple[FilePart, ...]] = field(default_factory=dict)
    meshes: int = 0
    triangles: int = 0

    @property
    def path(self) -> Path:
        """The file."""
        return self.opened.path

    def key_of(self, prim: "Usd.Prim") -> tuple[object, ...]:
        """What a mesh is made of: equal for instances that look alike, each in its own frame."""
        from pxr import UsdGeom, UsdShade

        own = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        shaded = [prim, *UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()]
        bound = tuple(self.material(each.GetPrim()) for each in shaded)
        above = tuple(str(primvar.GetAttr().GetPath())
                      for primvar in UsdGeom.PrimvarsAPI(prim.GetParent()).FindInheritablePrimvars()) \
            if prim.IsInstanceProxy() else ()
        return (str(own.GetPath()), bound, above)

    def parts(self, prim: "Usd.Prim", name: str, matrix: np.ndarray, *, rounds: int) -> list[FilePart]:
        """The parts of a mesh or shape, one for each of its materials, moved by a (4, 4) matrix. Raises UserError where
        it is no surface."""
        key = (*self.key_of(prim), rounds)
        if key not in self.made:
            with naming(self.path, name):
                self.made[key] = self._made(prim, rounds)
        self.meshes += 1
        self.triangles += sum(len(part.faces) for part in self.made[key])
        if self.triangles > MOST_TRIANGLES:
            refuse(self.path, "expected at most 50 million triangles, instances counted each, got more", at=name)
        return [self._moved(part, name, matrix) for part in self.made[key]]

    def _moved(self, part: FilePart, name: str, matrix: np.ndarray) -> FilePart:
        with np.errstate(all="ignore"):
            positions = part.positions @ matrix[:3, :3].T + matrix[:3, 3]
        if len(positions) and not np.abs(positions).max() <= FARTHEST:
            refuse(self.path, f"expected vertices within {FARTHEST:g} metres, got some beyond", at=name)
        turn = slice(None, None, -1 if np.linalg.det(matrix[:3, :3]) < 0 else 1)
        return replace(part, name=name, positions=positions, faces=part.faces[:, turn],
                       uvs={number: uvs[:, turn] for number, uvs in part.uvs.items()},
                       colors=None if part.colors is None else part.colors[:, turn])

    def _made(self, prim: "Usd.Prim", rounds: int) -> tuple[FilePart, ...]:
        mesh = read_mesh(self.path, prim, rounds=rounds, most=MOST_TRIANGLES - self.triangles)
        self.decided |= dict.fromkeys(mesh.decided)
        bound: dict[int, list[np.ndarray]] = {}
        for shade, faces in mesh.subsets:
            bound.setdefault(self.material(shade), []).append(faces)
        read = {"displayColor", *(self.materials[index].colors for index in bound if index >= 0)}
        self.left_out.update(f"colours {name}, which no material reads"
                             for name in mesh.color_names() if name not in read)
        chosen = [(index, np.isin(mesh.owner, np.concatenate(sets))) for index, sets in bound.items()]
        return tuple(self._part(mesh, index, which) for index, which in chosen if which.any())

    def _part(self, mesh: UsdMesh, index: int, chosen: np.ndarray) -> FilePart:
        """The (T,) chosen triangles of a mesh with one material."""
        material = self.materials[index] if index >= 0 else None
        corners = mesh.corners[chosen]
        uvs, colors = {}, None
        if material is None:
            colors = mesh.display_colors()
        else:
            if material.file.material.texture is not None:
                coordinates = mesh.coordinates(material.coordinates)
                if coordinates is None:
                    self.left_out[f"textures of {material.file.material.name} on a mesh without texture coordinates "
                                  f"{material.coordinates}"] += 1
                else:
                    uvs = {material.file.uv_set: coordinates[corners]}
                    if material.black and not ((coordinates >= 0) & (coordinates <= 1)).all():
                        self.left_out[f"black beyond the edges of textures of {material.file.material.name}"] += 1
            if material.colors and (colors := mesh.colors(material.colors)) is None:
                self.left_out[f"colours {material.colors}, which a mesh does not have"] += 1
        return FilePart(name=mesh.name, positions=mesh.positions, faces=mesh.indices[corners], material=index, uvs=uvs,
                        colors=None if colors is None else colors[corners])

    def material(self, prim: "Usd.Prim") -> int:
        """Index of the material that is bound to a prim; -1 for none, or none that is read."""
        from pxr import UsdShade

        unread = None
        for purpose in (UsdShade.Tokens.full, UsdShade.Tokens.preview):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
            if not material:
                continue
            if self.known.get(where := _where(material), -1) >= 0:
                return self.known[where]
            surface = material.ComputeSurfaceSource()[0]
            if surface and surface.GetIdAttr().Get() == "UsdPreviewSurface":
                return self._add(material, surface)
            unread = unread or material
        if unread and _where(unread) not in self.known:
            self.known[_where(unread)] = -1
            self.left_out[f"material {unread.GetPrim().GetName()}, which has no UsdPreviewSurface; displayColor is "
                          "taken for it"] += 1
        return -1

    def _add(self, material: "UsdShade.Material", surface: "UsdShade.Shader") -> int:
        """Index of a material that is new."""
        names = {each.file.material.name for each in self.materials}
        name = material.GetPrim().GetName()
        made = read_preview_surface(self.path, surface, name if name not in names else str(material.GetPath()),
                                    self.max_texture, self.opened.folders)
        if made.coordinates not in self.coordinates:
            self.coordinates.append(made.coordinates)
        file = replace(made.file, uv_set=self.coordinates.index(made.coordinates))
        self.materials.append(replace(made, file=file))
        self.known[_where(material)] = len(self.materials) - 1
        return len(self.materials) - 1


def _where(material: "UsdShade.Material") -> str:
    """Path of a material, the same for all instances that share it."""
    prim = material.GetPrim()
    return str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())
