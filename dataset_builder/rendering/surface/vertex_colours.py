"""Colours of vertices at a point of a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.assets.asset import Material, coverage_range, vertex_alphas
from dataset_builder.errors import PlanError
from dataset_builder.rendering.buffers import owned


@dataclass(frozen=True, kw_only=True, eq=False)
class VertexColours:
    """Colours and coverage of the corners of F triangles, whose vertices are 3 i to 3 i + 2."""

    colours: mi.Float
    """12 F floats."""
    positions: mi.Float
    """9 F floats or more, in the frame of the scene."""
    needs: frozenset[str]
    """Features that they call for."""

    @classmethod
    def of(cls, materials: Sequence[Material], face_material: np.ndarray, colors: np.ndarray | None,
           positions: mi.Float) -> VertexColours | None:
        """Upload (F, 3, 4) colours of faces with (F,) materials; None where all are 1. Raises PlanError for colours
        that no surface can have."""
        alphas = vertex_alphas(face_material, colors)
        if colors is None or not alphas:
            return None
        bad = ~((colors >= 0) & (colors <= 1)).all(axis=2)
        if bad.any():
            face, corner = np.argwhere(bad)[0]
            raise PlanError(f"vertex colours: expected values in [0, 1], got {np.count_nonzero(bad)} corners of "
                            f"{bad.size} that are not, the first {colors[face, corner].tolist()} at corner {corner} of "
                            f"face {face}")
        partly = any(coverage_range(materials[index], found)[0] < 1 for index, found in alphas.items())
        return cls(colours=owned(mi.Float, colors.astype(np.float32)), positions=positions,
                   needs=frozenset({"colours", "coverage"} if partly else {"colours"}))

    def at(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Vector4f:
        """Interpolated between the corners: their weights are the shares of the area (Ericson, "Real-time collision
        detection", 2005, section 3.4)."""
        first = 3 * si.prim_index
        a, b, c = (dr.gather(mi.Point3f, self.positions, first + corner, active) for corner in range(3))
        along_b, along_c, to = b - a, c - a, si.p - a
        across = dr.cross(along_b, along_c)
        area = dr.squared_norm(across)
        # Slivers of scans may have none in single precision: they show their first corner
        v, w = (dr.select(area > 0, dr.clip(dr.dot(part, across) / area, 0, 1), 0)
                for part in (dr.cross(to, along_c), dr.cross(along_b, to)))
        w = dr.minimum(w, 1 - v)
        u = 1 - v - w
        corners = (dr.gather(mi.Vector4f, self.colours, first + corner, active) for corner in range(3))
        return sum((weight * corner for weight, corner in zip((u, v, w), corners, strict=True)), mi.Vector4f(0))
