"""A field as the files that other programs open: Gaussian splats, or its mesh with colours at vertices."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset_builder.extras import missing_named
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.tonemap import srgb

if TYPE_CHECKING:
    from pxr import Usd

FULL = 1 - 1e-6
"""Opacity that one of 1 is written as: its logit is no number."""


def splats_ply(cloud: SplatCloud) -> bytes:
    """As Kerbl and others write splats. Colours that are not sRGB-encoded stay as they are: the format cannot say."""
    rest = cloud.harmonics[:, 1:].transpose(0, 2, 1).reshape(len(cloud), -1)
    opacity = np.minimum(cloud.opacities.astype(np.float64), FULL)
    rows = np.concatenate([
        cloud.centres, np.zeros((len(cloud), 3)), cloud.harmonics[:, 0], rest,
        np.log(opacity / (1 - opacity))[:, None], np.log(cloud.scales), cloud.turns], axis=1)
    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{k}" for k in range(3)),
             *(f"f_rest_{k}" for k in range(rest.shape[1])), "opacity", *(f"scale_{k}" for k in range(3)),
             *(f"rot_{k}" for k in range(4))]
    return _ply_head([("vertex", len(cloud), [f"float {name}" for name in names])]) + rows.astype("<f4").tobytes()


def mesh_ply(mesh: TriangleMesh) -> bytes:
    """Triangles with 8-bit sRGB colours; vertices of one place and several colours are written for each."""
    positions, faces, colours = _by_vertex(mesh)
    vertices = np.zeros(len(positions), [("at", "<f4", 3), ("colour", "u1", 3)])
    vertices["at"], vertices["colour"] = positions, np.round(255 * srgb(colours))
    triangles = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, faces
    columns = ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue"]
    head = _ply_head([("vertex", len(positions), columns),
                      ("face", len(faces), ["list uchar int vertex_indices"])])
    return head + vertices.tobytes() + triangles.tobytes()


def _ply_head(elements: list[tuple[str, int, list[str]]]) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", "comment metres, z is up"]
    for name, count, columns in elements:
        lines += [f"element {name} {count}", *(f"property {column}" for column in columns)]
    return "\n".join([*lines, "end_header", ""]).encode()


def mesh_glb(mesh: TriangleMesh) -> bytes:
    """One matt primitive of glTF 2.0; y is up."""
    positions, faces, colours = _by_vertex(mesh)
    x, y, z = positions.T
    arrays = [("VEC3", 5126, np.stack([x, z, -y], axis=1).astype("<f4")), ("VEC3", 5126, colours.astype("<f4")),
              ("SCALAR", 5125, faces.reshape(-1, 1).astype("<u4"))]
    views, accessors, start = [], [], 0
    for number, (kind, component, values) in enumerate(arrays):
        views.append({"buffer": 0, "byteOffset": start, "byteLength": values.nbytes})
        bounds = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()} if number == 0 else {}
        accessors.append({"bufferView": number, "componentType": component, "count": len(values), "type": kind,
                          **bounds})
        start += values.nbytes
    header: dict[str, Any] = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}, "doubleSided": True}],
        "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": start}]}
    text = json.dumps(header, sort_keys=True).encode()
    text += b" " * (-len(text) % 4)
    return (struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + start, len(text), b"JSON") + text
            + struct.pack("<I4s", start, b"BIN\0") + b"".join(values.tobytes() for _, _, values in arrays))


def splats_usd(cloud: SplatCloud, suffix: str) -> bytes:
    """A stage with a ParticleField3DGaussianSplat, in metres, z up, whose colour space is stated."""
    def fill(stage: "Usd.Stage") -> None:
        """Put the splats on a stage."""
        from pxr import Sdf, Usd, Vt

        prim = stage.DefinePrim("/field", "ParticleField3DGaussianSplat")
        Usd.ColorSpaceAPI.Apply(prim).CreateColorSpaceNameAttr(
            "srgb_rec709_scene" if cloud.srgb else "lin_rec709_scene")
        types = Sdf.ValueTypeNames
        values = {"positions": Vt.Vec3fArray.FromNumpy(cloud.centres),
                  "scales": Vt.Vec3fArray.FromNumpy(cloud.scales),
                  "orientations": Vt.QuatfArray.FromNumpy(np.roll(cloud.turns, -1, axis=1)),
                  "opacities": Vt.FloatArray.FromNumpy(cloud.opacities),
                  "radiance:sphericalHarmonicsCoefficients": Vt.Vec3fArray.FromNumpy(
                      np.ascontiguousarray(cloud.harmonics.reshape(-1, 3)))}
        for name, value in values.items():
            prim.GetAttribute(name).Set(value)
        degree = int(cloud.harmonics.shape[1]**0.5) - 1
        prim.CreateAttribute("radiance:sphericalHarmonicsDegree", types.Int, False, Sdf.VariabilityUniform).Set(degree)

    return _stage(fill, suffix)


def mesh_usd(mesh: TriangleMesh, suffix: str) -> bytes:
    """A stage with a mesh, in metres, z up, its colours as displayColor."""
    def fill(stage: "Usd.Stage") -> None:
        """Put the mesh on a stage."""
        from pxr import UsdGeom, Vt

        positions, faces, colours = _by_vertex(mesh)
        made = UsdGeom.Mesh.Define(stage, "/field")
        made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(positions.astype(np.float32)))
        made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
        made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()))
        made.CreateSubdivisionSchemeAttr("none")
        made.CreateDisplayColorPrimvar("vertex").Set(Vt.Vec3fArray.FromNumpy(colours.astype(np.float32)))

    return _stage(fill, suffix)


def _stage(fill: Callable[["Usd.Stage"], None], suffix: str) -> bytes:
    with missing_named():
        from pxr import Usd, UsdGeom
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    fill(stage)
    stage.SetDefaultPrim(stage.GetPrimAtPath("/field"))
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"field{suffix}"
        stage.GetRootLayer().Export(str(path))
        return path.read_bytes()


def _by_vertex(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(V, 3) positions, (F, 3) faces and (V, 3) linear colours, vertices split where their corners differ in colour."""
    shown = np.ones((*mesh.faces.shape, 3), np.float32) if mesh.colors is None else mesh.colors[..., :3]
    rows = np.column_stack([mesh.faces.ravel(), shown.reshape(-1, 3)])
    distinct, corner = np.unique(rows, axis=0, return_inverse=True)
    return mesh.positions[distinct[:, 0].astype(int)], corner.reshape(-1, 3), distinct[:, 1:]
