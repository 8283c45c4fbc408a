"""How values of a field become opacity and radiance, and what a ray gathers of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.field.field_grid import Corners

Kind = Literal["density", "sdf"]
GAIN, SHIFT = 3.0, -12.0
"""Optical depth of a cell of density v is softplus(GAIN v + SHIFT): 6e-6 where there is nothing."""
FIRST_DENSITY, FIRST_COLOUR = 3.0, 0.3
"""Values that a fit begins with: an optical depth of 0.05 and a radiance of 0.37."""
UNIT = 2 / 256
"""Length that distances are counted in, radii: so short that distances may change as fast as colours do."""
OUTSIDE = 16.0
"""Distance, in UNITs, of a cell whose value is 0: values are OUTSIDE - distance."""
COLOUR_BEND = 4.0


def softplus(x: mi.Float) -> mi.Float:
    """log(1 + exp(x))."""
    return dr.maximum(x, 0) + dr.log(1 + dr.exp(-dr.abs(x)))


@dataclass(kw_only=True, eq=False)
class FieldModel:
    """One kind of field on a grid of some size."""

    kind: Kind
    cell: mi.Float
    """Side of a cell, radii."""
    sharpness: mi.Float
    """Of a distance: inverse width of the logistic density, per UNIT."""

    def optical(self, corners: Corners, value: mi.Vector4f, direction: mi.Vector3f, step: mi.Float) -> mi.Float:
        """Optical depth of a step about a point, `step` radii long.

        Density is activated after interpolation (Sun et al., "Direct voxel grid optimization", 2022), in units of a
        cell. A distance d is seen as in NeuS (Wang et al. 2021): what passes a step is Phi(d after) / Phi(d before),
        with Phi the logistic function, where d falls along the ray.
        """
        if self.kind == "density":
            return softplus(GAIN * value.x + SHIFT) * step / self.cell
        rise = dr.maximum(dr.dot(corners.gradient(), direction) / self.cell, 0)
        distance, half = OUTSIDE - value.x, 0.5 * step * rise
        return softplus((half - distance) * self.sharpness) - softplus((-half - distance) * self.sharpness)


def radiance(value: mi.Vector4f) -> mi.Color3f:
    """Radiance of a point, >= 0, in units of the field's white."""
    return mi.Color3f(*(softplus(COLOUR_BEND * channel) / COLOUR_BEND for channel in (value.y, value.z, value.w)))


def weights(optical: mi.Float, samples: int) -> mi.Float:
    """What each of `samples` neighbouring steps along a ray adds to it, of the optical depths of steps."""
    before = dr.block_prefix_sum(optical, samples, exclusive=True)
    return dr.exp(-before) * (1 - dr.exp(-optical))
