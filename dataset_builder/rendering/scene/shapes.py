"""Arrays -> Mitsuba meshes. The only file that knows Mitsuba's mesh parameter names."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.rendering.buffers import owned

MIN_HALF_SIZE = 256.0
"""Half the side of the cube that scenes are padded to: rooms a hundred times as large as the object fit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Triangles:
    """F separate triangles on the device, so that normals and texture coordinates may differ at every corner.

    positions, normals: 9 F + 6 floats. uvs: 6 F + 4 floats. indices: 3 F integers, 0 to 3 F - 1. The last two vertices
    belong to no triangle; see `upload`.
    """

    positions: mi.Float
    normals: mi.Float
    uvs: mi.Float
    indices: mi.UInt32


def upload(corners: np.ndarray, normals: np.ndarray, uvs: np.ndarray) -> Triangles:
    """corners: (F, 3, 3) world positions. normals: (F, 3, 3) unit shading normals. uvs: (F, 3, 2).

    Two loose vertices stretch the bounding box to a cube about the origin whose size is a power of two: Mitsuba's
    directional emitter makes the scene's bounding sphere a literal of the kernel, and scenes of all rooms shall share
    one kernel.
    """
    reach = max(float(np.abs(corners).max(initial=0.0)), MIN_HALF_SIZE)
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


def _flat(rows: np.ndarray, last: np.ndarray) -> mi.Float:
    return owned(mi.Float, np.concatenate([rows, last]).astype(np.float32))
