"""One step of a fit: rays through pixels, what they gather, how far that is from the images, and Adam."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
from drjit.opt import Adam

from dataset_builder.assets.field_file import CHANNELS
from dataset_builder.rendering.field.field_grid import FieldGrid
from dataset_builder.rendering.field.field_model import UNIT, FieldModel, Kind, radiance, weights
from dataset_builder.rendering.field.field_pixels import FitPixels
from dataset_builder.seeding import derive_seed

RAYS, SAMPLES = 1 << 12, 48
"""Rays of a step, and samples along each."""
PAIRS = 1 << 14
"""Cells whose neighbours are looked at in a step."""
EPSILON = 0.25
"""Radiance, in units of white, about which the loss turns from absolute to relative error."""
OPACITY_WEIGHT = 0.5


@dataclass(frozen=True, kw_only=True)
class Smoothness:
    """Of what keeps a field smooth."""

    variation: float = 0.0
    """Squared differences of density between neighbours."""
    eikonal: float = 0.0
    """Squared difference of a distance's slope from 1."""
    bend: float = 0.0
    """Squared second differences of distance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """Random numbers of one step: they depend on the seed, the step and what they are for, on nothing else."""

    low: mi.UInt32
    high: mi.UInt32

    @classmethod
    def of(cls, seed: int, number: int) -> Drawn:
        """Those of step `number`; seed: 64 bits."""
        mixed = derive_seed(seed, "step", number)
        return cls(low=dr.opaque(mi.UInt32, mixed & 0xFFFFFFFF), high=dr.opaque(mi.UInt32, mixed >> 32))

    def bits(self, count: int, purpose: int) -> tuple[mi.UInt32, mi.UInt32]:
        """(count,) twice, 32 bits each."""
        lane = dr.arange(mi.UInt32, count) * 8 + purpose
        return mi.sample_tea_32(lane ^ self.low, self.high)

    def uniform(self, count: int, purpose: int) -> tuple[mi.Float, mi.Float]:
        """(count,) twice in [0, 1)."""
        return tuple(mi.Float(bits >> 8) * mi.Float(2**-24) for bits in self.bits(count, purpose))


@dataclass(frozen=True, kw_only=True, eq=False)
class Losses:
    """Of one step, on the device."""

    total: mi.Float
    error: mi.Float
    """Squared error of colours inside masks, as they are displayed, summed."""
    inside: mi.Float
    """Number of values that it is summed over."""


def take_step(grid: FieldGrid, optimiser: Adam, model: FieldModel, pixels: FitPixels, smooth: Smoothness,
              drawn: Drawn) -> Losses:
    """Change the values of the optimiser's `table`, rows of `grid`, for the better."""
    table = optimiser["table"]
    choice = dr.mul_hi(drawn.bits(RAYS, 0)[0], dr.opaque(mi.UInt32, pixels.count))
    image, corner = (dr.gather(mi.UInt32, values, choice) for values in (pixels.image, pixels.corner))
    near, far = (dr.gather(mi.Float, values, choice) for values in (pixels.near, pixels.far))
    truth = dr.gather(mi.Vector4f, pixels.colour, choice)
    dx, dy = drawn.uniform(RAYS, 1)
    x, y = mi.Float(corner & 0xFFFF) + dx, mi.Float(corner >> 16) + dy
    origin, direction = pixels.cameras.rays(image, x, y)
    dr.eval(origin, direction, near, far, truth)
    colour, opacity = gathered(grid, table, model, origin, direction, near, far, drawn.uniform(RAYS, 2)[0])
    target = mi.Color3f(truth.x, truth.y, truth.z)
    # The gradient of a logarithmic curve, and still unbiased under noise without a mean (Mildenhall et al. 2022)
    relative = (colour - target) * (2 * EPSILON / (dr.detach(colour) + EPSILON))
    loss = dr.mean(dr.squared_norm(relative) / 3 + OPACITY_WEIGHT * dr.square(opacity - truth.w))
    loss += evenness(grid, table, model.kind, smooth, drawn)
    dr.backward(loss)
    optimiser.step()
    with dr.suspend_grad():
        shown = displayed(colour) - displayed(target)
        inside = truth.w > 0.5
        error = dr.sum(dr.select(inside, dr.squared_norm(shown), 0))
        return Losses(total=dr.detach(loss), error=dr.detach(error), inside=3 * dr.sum(mi.Float(inside)))


def gathered(grid: FieldGrid, table: mi.Float, model: FieldModel, origin: mi.Point3f, direction: mi.Vector3f,
             near: mi.Float, far: mi.Float, jitter: mi.Float) -> tuple[mi.Color3f, mi.Float]:
    """Radiance and opacity of rays: SAMPLES even steps from `near` to `far`, each looked at where `jitter` says."""
    rays = dr.width(near)
    lane = dr.arange(mi.UInt32, rays * SAMPLES)
    ray = lane // SAMPLES
    slot = lane - ray * SAMPLES
    o, d = dr.gather(mi.Point3f, origin, ray), dr.gather(mi.Vector3f, direction, ray)
    length = dr.gather(mi.Float, (far - near) / SAMPLES, ray)
    t = dr.gather(mi.Float, near, ray) + (mi.Float(slot) + dr.gather(mi.Float, jitter, ray)) * length
    corners = grid.corners(table, o + t * d, mi.Bool(True))
    value = corners.value()
    weight = weights(model.optical(corners, value, d, length), SAMPLES)
    colour = radiance(value) * weight
    return mi.Color3f(*(dr.block_sum(channel, SAMPLES) for channel in colour)), dr.block_sum(weight, SAMPLES)


def evenness(grid: FieldGrid, table: mi.Float, kind: Kind, smooth: Smoothness, drawn: Drawn) -> mi.Float:
    """What is uneven about some cells."""
    row = dr.mul_hi(drawn.bits(PAIRS, 3)[0], dr.opaque(mi.UInt32, dr.width(grid.cells)))
    cell = dr.gather(mi.UInt32, grid.cells, row)
    own = dr.gather(mi.Float, table, CHANNELS * row)
    rises, bends = [], []
    for stride in (mi.UInt32(1), grid.side, grid.side * grid.side):
        # The outermost cells are never active
        ahead = dr.gather(mi.UInt32, grid.rows, cell + stride)
        there = ahead > 0
        rises.append(dr.select(there, dr.gather(mi.Float, table, CHANNELS * (ahead - 1), there) - own, 0))
        if kind == "sdf":
            behind = dr.gather(mi.UInt32, grid.rows, cell - stride)
            both = there & (behind > 0)
            before = dr.gather(mi.Float, table, CHANNELS * (behind - 1), both)
            bends.append(dr.select(both, rises[-1] + before - own, 0))
    steep = sum(dr.square(rise) for rise in rises)
    if kind == "density":
        return smooth.variation * dr.mean(steep) / 3
    scale = UNIT * 0.5 * mi.Float(grid.side)
    slope = dr.sqrt(dr.maximum(steep, 1e-8)) * scale
    bent = sum(dr.square(bend * scale) for bend in bends)
    return smooth.eikonal * dr.mean(dr.square(slope - 1)) + smooth.bend * dr.mean(bent) / 3


def displayed(colour: mi.Color3f) -> mi.Color3f:
    """sRGB-encoded, clipped to [0, 1] (IEC 61966-2-1)."""
    value = dr.clip(colour, 0, 1)
    return dr.select(value <= 0.0031308, 12.92 * value, 1.055 * dr.power(dr.maximum(value, 1e-6), 1 / 2.4) - 0.055)
