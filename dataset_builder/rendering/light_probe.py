"""The light about an object as spherical harmonics: radiance that arrives at a point in the air from all directions.

Lights are sampled from the point and directions uniformly over the sphere, combined by multiple importance sampling,
as fog does it where it scatters evenly (`integrator`): so lamps without a size count, which no direction would meet.
"""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.geometry.harmonics import COUNT, basis
from dataset_builder.rendering.sampling.estimate import Integrand, Samplers, estimate
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.transport.light_sampling import World, balance, in_air, sample_emitter
from dataset_builder.rendering.transport.path_tracer import PathStart, incident_radiance

DIRECTIONS, BATCHES = 1 << 15, 32
"""Uniform directions behind each set of coefficients, each with a light sample beside it, and independent batches of
them, each stratified in itself."""

CHANNELS = 3 * COUNT
"""Of the estimate: red, green and blue of one function after the other."""


def lighting(opened: OpenScene, *, max_depth: int, rr_depth: int, seed: int, at: Sequence[float] = (0.0, 0.0, 0.0),
             directions: int = DIRECTIONS) -> Estimate:
    """(1, 27) coefficients of the radiance that arrives at a point, and their standard errors.

    at: in the local frame. max_depth, rr_depth: as in `integrator.trace`, an edge from a camera to the point counted,
    so that a surface there would be lit by paths of the same length. seed: 64 bits.
    """
    longest, roulette = (dr.opaque(mi.UInt32, depth) for depth in (max_depth, rr_depth))
    point = mi.Point3f(*(dr.opaque(mi.Float, float(value)) for value in at))
    world = World(opened.scene, longest, roulette, opened.features, opened.fog, opened.portals)
    # One pixel, whose area is the sphere
    return estimate(_integrand(world, point), np.zeros(1, dtype=np.int64), width=1, height=1, spp=directions,
                    batches=BATCHES, seed=seed)


def _integrand(world: World, at: mi.Point3f) -> Integrand:
    def integrand(samplers: Samplers, position: mi.Vector2f) -> list[mi.Float]:
        direction = mi.warp.square_to_uniform_sphere(mi.Point2f(position))
        point = in_air(mi.Ray3f(at, direction), mi.Float(0))
        active = mi.Bool(world.max_depth > 1)

        # Sample an emitter: L_e w T / p
        ds, em_weight = sample_emitter(world, point, samplers.strata.next_2d(active), active)
        mis = dr.select(ds.delta, 1, balance(ds.pdf, mi.Float(dr.inv_four_pi)))
        direct = dr.select(active & (ds.pdf != 0), em_weight * mis, 0)

        # Sample a direction: L_i / p, p = 1 / (4 pi)
        start = PathStart(point=point, direction=direction, pdf=mi.Float(dr.inv_four_pi), delta=mi.Bool(False),
                          depth=mi.UInt32(1), prior_throughput=mi.Float(1), channels=mi.Float(0),
                          inside=mi.UInt32(0))
        indirect = 4 * dr.pi * incident_radiance(world, samplers.rest, start, active)

        # Project on the basis (Ramamoorthi and Hanrahan 2001): L_lm = integral of L_i Y_lm
        functions = zip(basis(*ds.d), basis(*direction), strict=True)
        return [channel for y_em, y in functions for channel in direct * y_em + indirect * y]

    return integrand
