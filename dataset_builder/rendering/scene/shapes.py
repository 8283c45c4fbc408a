"""Arrays -> Mitsuba meshes. The only file that knows Mitsuba's mesh parameter names."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.rendering.buffers import owned

MIN_HALF_SIZE = 256.0
"""Half the side of the cube that scenes are padded to: rooms a hundred times as large as the object fit."""

MAX_RADIUS = 0.05
"""Radius below which a ball is a mesh, in units of the frame, where the target object is about one large: a sphere of
this radius is 0.1% off at a distance of five objects."""

SUBDIVISIONS = 4
"""Of an octahedron: 2048 faces, round to a thousandth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Triangles:
    """F separate triangles on the device, so that normals and texture coordinates may differ at every corner.

    The last two vertices belong to no triangle; see `upload`.
    """

    positions: mi.Float
    """9 F + 6 floats."""
    normals: mi.Float
    """9 F + 6 floats."""
    uvs: mi.Float
    """6 F + 4 floats."""
    indices: mi.UInt32
    """3 F integers, 0 to 3 F - 1."""


def upload(corners: np.ndarray, normals: np.ndarray, uvs: np.ndarray) -> Triangles:
    """corners: (F, 3, 3) world positions. normals: (F, 3, 3) unit shading normals. uvs: (F, 3, 2).

    Two loose vertices stretch the bounding box to a cube about the origin whose size is a power of two: Mitsuba's
    directional emitter makes the scene's bounding sphere a literal of the kernel, and scenes of all rooms shall share
    one kernel.
    """
    reach = max(float(corners.max(initial=0.0)), -float(corners.min(initial=0.0)), MIN_HALF_SIZE)
    half = 2.0 ** np.ceil(np.log2(reach))
    loose = np.array([[-half] * 3, [half] * 3])
    upwards = np.array([[0.0, 0, 1]] * 2)
    return Triangles(positions=_flat(corners.reshape(-1, 3), loose), normals=_flat(normals.reshape(-1, 3), upwards),
                     uvs=_flat(uvs.reshape(-1, 2), np.zeros((2, 2))),
                     indices=owned(mi.UInt32, np.arange(3 * len(corners), dtype=np.uint32)))


def mesh_of(triangles: Triangles, bsdf: mi.BSDF) -> mi.Mesh:
    """A Mitsuba mesh; triangle i of the arrays is prim_index i."""
    props = mi.Properties()
    props["surface"] = bsdf
    vertices, faces = dr.width(triangles.positions) // 3, dr.width(triangles.indices) // 3
    mesh = mi.Mesh("scene", vertex_count=vertices, face_count=faces, has_vertex_normals=True, has_vertex_texcoords=True,
                   props=props)
    params = mi.traverse(mesh)
    params["vertex_positions"], params["vertex_normals"] = triangles.positions, triangles.normals
    params["vertex_texcoords"], params["faces"] = triangles.uvs, triangles.indices
    params.update()
    return mesh


def is_small_sphere(light: LightPlan) -> bool:
    """Whether a light is a ball too small for Mitsuba's sphere.

    That is sampled by the cone under which it is seen, 1 - cos of a small angle: in single precision that has lost a
    hundredth of its value where the ball is seen under a third of a degree, and all of it under a sixtieth. Triangles
    have no such trouble; they are sampled by area, half of them in vain, so large balls stay spheres.
    """
    return light.kind == "sphere" and light.size < MAX_RADIUS


def small_sphere(light: LightPlan, bsdf: dict[str, Any], emitter: dict[str, Any]) -> mi.Mesh:
    """A ball light as triangles whose surface has the ball's area, so that it sends the ball's power."""
    corners = unit_sphere() * light.size + np.array(light.position)
    props = mi.Properties()
    props["surface"], props["light"] = mi.load_dict(bsdf), mi.load_dict(emitter)
    mesh = mi.Mesh("bead", vertex_count=3 * len(corners), face_count=len(corners), props=props)
    params = mi.traverse(mesh)
    params["vertex_positions"] = owned(mi.Float, corners.astype(np.float32).ravel())
    params["faces"] = owned(mi.UInt32, np.arange(3 * len(corners), dtype=np.uint32))
    params.update()
    return mesh


@cache
def unit_sphere() -> np.ndarray:
    """(F, 3, 3) outward triangles about the origin, of area 4 pi together."""
    ends = np.eye(3)
    faces = np.array([(x * ends[0], y * ends[1], z * ends[2]) if x * y * z > 0 else (y * ends[1], x * ends[0],
                                                                                     z * ends[2])
                      for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    for _ in range(SUBDIVISIONS):
        a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
        ab, bc, ca = ((p + q) / np.linalg.norm(p + q, axis=1, keepdims=True) for p, q in ((a, b), (b, c), (c, a)))
        faces = np.concatenate([np.stack(three, axis=1) for three in ((a, ab, ca), (b, bc, ab), (c, ca, bc),
                                                                      (ab, bc, ca))])
    area = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1).sum() / 2
    return faces * np.sqrt(4 * np.pi / area)


def _flat(rows: np.ndarray, last: np.ndarray) -> mi.Float:
    values = np.empty((len(rows) + len(last), rows.shape[1]), np.float32)
    values[:len(rows)], values[len(rows):] = rows, last
    return owned(mi.Float, values)
