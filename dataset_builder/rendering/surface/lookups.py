"""Tables over (roughness, cosine), read on the device."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.reflectance import COSINES, ROUGHNESSES


def interpolated(kind: Any, table: mi.Float, cosine: mi.Float, roughness: mi.Float, active: mi.Bool) -> Any:
    """Bilinear value, a `kind` (mi.Float or mi.Vector2f), of a flat (ROUGHNESSES, COSINES, ...) table."""
    x = dr.clip(cosine, 0, 1) * (COSINES - 1)
    y = dr.clip(roughness, 0, 1) * (ROUGHNESSES - 1)
    column = dr.minimum(mi.UInt32(x), COSINES - 2)
    line = dr.minimum(mi.UInt32(y), ROUGHNESSES - 2)
    fx, fy = x - mi.Float(column), y - mi.Float(line)
    first = line * COSINES + column
    corners = [dr.gather(kind, table, first + step, active) for step in (0, 1, COSINES, COSINES + 1)]
    return dr.lerp(dr.lerp(corners[0], corners[1], fx), dr.lerp(corners[2], corners[3], fx), fy)
