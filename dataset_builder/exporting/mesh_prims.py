"""Triangles -> a mesh prim: points, what lies on the corners of faces, and a subset of the faces of each material."""

from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.exporting.placed_things import prim_name
from dataset_builder.exporting.preview_surfaces import COLOR, COORDINATES, OPACITY, SurfaceWriter
from dataset_builder.rendering.scene.triangle_soup import Soup

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom


def welded(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) float32 points, each once, and (F, 3) int32 indices into them, of (F, 3, 3) corners."""
    # Adding 0 makes -0 equal to 0
    rows = np.ascontiguousarray(corners.reshape(-1, 3).astype(np.float32) + np.float32(0))
    _, first, inverse = np.unique(rows.view(np.dtype((np.void, 12))).ravel(), return_index=True, return_inverse=True)
    # In the order in which faces name them
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return rows[first[order]], place[inverse].reshape(-1, 3).astype(np.int32)


def write_mesh(stage: "Usd.Stage", path: str, soup: Soup, surfaces: SurfaceWriter) -> "UsdGeom.Mesh":
    """The mesh prim of a soup at `path`, with materials bound to it."""
    from pxr import Gf, Sdf, UsdGeom, Vt

    points, faces = welded(soup.corners)
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateOrientationAttr("rightHanded")
    mesh.CreateDoubleSidedAttr(True)
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.zeros(3))
    mesh.CreateExtentAttr([Gf.Vec3f(*low.tolist()), Gf.Vec3f(*high.tolist())])
    types, on_corners = Sdf.ValueTypeNames, UsdGeom.PrimvarsAPI(mesh)
    values = {"normals": (types.Normal3fArray, Vt.Vec3fArray, soup.normals),
              COORDINATES: (types.TexCoord2fArray, Vt.Vec2fArray, soup.uvs)}
    colors = painted(soup)
    if colors is not None:
        values[COLOR] = types.Color3fArray, Vt.Vec3fArray, colors[..., :3]
        values[OPACITY] = types.FloatArray, Vt.FloatArray, colors[..., 3:]
    for name, (kind, array, numbers) in values.items():
        flat = np.ascontiguousarray(numbers.reshape(-1, numbers.shape[-1]), dtype=np.float32)
        primvar = on_corners.CreatePrimvar(name, kind, UsdGeom.Tokens.faceVarying)
        primvar.Set(array.FromNumpy(flat.ravel() if flat.shape[1] == 1 else flat))
    _bind(mesh, soup, surfaces)
    return mesh


def painted(soup: Soup) -> np.ndarray | None:
    """(F, 3, 4) base colour and coverage of every corner, factors of materials included; None where no vertex has a
    colour."""
    if soup.colors is None or not len(soup.colors) or (soup.colors == 1).all():
        return None
    factors = np.array([(*material.base_color, material.alpha) for material in soup.materials])
    return soup.colors * factors[soup.material][:, None]


def _bind(mesh: "UsdGeom.Mesh", soup: Soup, surfaces: SurfaceWriter) -> None:
    """Bind the material, or a subset of faces to each of several."""
    from pxr import UsdGeom, UsdShade, Vt

    api, taken, used = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()), list[str](), np.unique(soup.material)
    for index in used:
        faces, material = np.flatnonzero(soup.material == index).astype(np.int32), soup.materials[index]
        own = None if soup.colors is None else soup.colors[faces]
        colors = own is not None and bool((own[..., :3] != 1).any())
        opacities = own is not None and bool((own[..., 3] != 1).any())
        bound = surfaces.material(material, colors=colors, opacities=opacities)
        if len(used) == 1:
            api.Bind(bound)
            return
        taken.append(prim_name(material.name, taken))
        subset = UsdGeom.Subset.CreateGeomSubset(mesh, taken[-1], UsdGeom.Tokens.face, Vt.IntArray.FromNumpy(faces),
                                                 "materialBind")
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(bound)
    UsdShade.MaterialBindingAPI(mesh).SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.partition)
