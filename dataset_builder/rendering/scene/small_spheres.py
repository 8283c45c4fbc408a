"""Ball lights too small for Mitsuba's sphere, as meshes.

Its sphere is sampled by the cone under which it is seen, 1 - cos of a small angle: in single precision that has lost a
hundredth of its value where the ball is seen under a third of a degree, and all of it under a sixtieth. Triangles have
no such trouble; they are sampled by area, half of them in vain, so large balls stay spheres.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import mitsuba as mi
import numpy as np

from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.rendering.buffers import owned

MAX_RADIUS = 0.05
"""Radius below which a ball is a mesh, in units of the frame, where the target object is about one large: a sphere of
this radius is 0.1% off at a distance of five objects."""

SUBDIVISIONS = 4
"""Of an octahedron: 2048 faces, round to a thousandth."""


def is_small_sphere(light: LightPlan) -> bool:
    """Whether a light is a ball too small to be a sphere."""
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
