"""What all legs of a light path share: the scene, its limits, and emitter samples through panes, gaps and fog."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.first_hit import transparency
from dataset_builder.rendering.transport.fog import Fog

Passes = Callable[["mi.BSDFPtr", "mi.SurfaceInteraction3f", "mi.Bool"], "mi.Color3f"]
Towards = Callable[["mi.Interaction3f", "mi.Point3f"], "mi.Ray3f"]


class World:
    """A scene as paths see it. What is switched off leaves no trace in a kernel.

    max_depth: edges of the longest path. rr_depth: where Russian roulette starts. fog: None for clear air.
    """

    def __init__(self, scene: mi.Scene, max_depth: mi.UInt32, rr_depth: mi.UInt32, features: frozenset[str],
                 fog: Fog | None):
        self.scene, self.max_depth, self.rr_depth = scene, max_depth, rr_depth
        self.fog = fog
        self.glass = "glass" in features
        """Whether kernels handle refracting bodies."""
        self.thin = "thin" in features
        """Whether kernels handle panes that light passes straight."""
        self.transmits = bool(features & {"glass", "thin"})
        """Whether surfaces send light through to their other side."""
        self.straight = bool(features & {"thin", "coverage"})
        """Whether light passes anything straight: panes, or what is not there."""
        self.coverage = "coverage" in features
        """Whether surfaces may be there in part."""
        self.emission = "emission" in features
        """Whether surfaces send out light of their own."""
        self.dispersion = "dispersion" in features
        """Whether glass spreads colours."""


def same_side(world: World, si: mi.SurfaceInteraction3f, came: mi.Vector3f, goes: mi.Vector3f) -> mi.Bool:
    """Whether a path that comes along `came` leaves a surface to the side that it came from; anything is where surfaces
    send light through."""
    if world.transmits:
        return mi.Bool(True)
    return dr.dot(si.n, came) * dr.dot(si.n, goes) < 0


@dataclass
class FreeFlight:
    """How far a ray gets on its way to the next surface."""

    transmittance: mi.Float
    """Share of light that gets to that surface."""
    collided: mi.Bool
    """Whether the fog scatters the ray before."""
    point: mi.Interaction3f
    """Where it does, or the surface."""


def sample_free_flight(world: World, ray: mi.Ray3f, si: mi.SurfaceInteraction3f, sampler: mi.Sampler,
                       active: mi.Bool) -> FreeFlight:
    """A random flight along a ray that meets `si`; nothing happens in clear air."""
    if world.fog is None:
        return FreeFlight(transmittance=mi.Float(1), collided=mi.Bool(False), point=si)
    segment = world.fog.segment(ray.o, ray.d, si.t)
    distance, collided = world.fog.sample_distance(segment, sampler.next_1d(active))
    point = dr.select(collided, in_air(ray, distance), mi.Interaction3f(si))
    return FreeFlight(transmittance=world.fog.transmittance(segment), collided=collided, point=point)


def in_air(ray: mi.Ray3f, distance: mi.Float) -> mi.Interaction3f:
    """A point on a ray, away from any surface."""
    point = dr.zeros(mi.Interaction3f)
    point.t, point.p, point.time, point.wavelengths = distance, ray(distance), ray.time, ray.wavelengths
    return point


def sample_emitter(world: World, point: mi.Interaction3f, sample: mi.Point2f,
                   active: mi.Bool) -> tuple[mi.DirectionSample3f, mi.Color3f]:
    """A direction to an emitter, and L_e T / p: the radiance that arrives from it through panes, gaps and fog, over
    its density. Next event estimation (Pharr et al. 2023, section 13.4)."""
    ds, weight = world.scene.sample_emitter_direction(point, sample, not world.straight, active)
    if world.straight:
        weight = weight * straight_on(world.scene, point, ds.p, transparency, active & (ds.pdf != 0))
    if world.fog is not None:
        weight = weight * world.fog.transmittance(world.fog.segment(point.p, ds.d, ds.dist))
    return ds, weight


def to_lamp(point: mi.Interaction3f, end: mi.Point3f) -> mi.Ray3f:
    """A shadow ray to a point that lies on something, which it leaves out with the last thousandth of the way."""
    return point.spawn_ray_to(end)


def to_its_end(point: mi.Interaction3f, end: mi.Point3f) -> mi.Ray3f:
    """A shadow ray to a point in free air: a wall is met even where it stands just before the point."""
    ray = point.spawn_ray_to(end)
    ray.maxt = dr.norm(end - ray.o)
    return ray


@dr.syntax
def straight_on(scene: mi.Scene, point: mi.Interaction3f, end: mi.Point3f, passes: Passes, active: mi.Bool,
                towards: Towards = to_lamp) -> mi.Color3f:
    """Share of light that comes straight from `end` to `point` through whatever stands between; 0 behind what is
    opaque. passes: what a surface lets through, `transparency` for light. towards: makes shadow rays."""
    # Loop state
    ray = towards(point, end)         # What is left of the shadow ray
    transmittance = mi.Color3f(1)    # Share that passes all surfaces so far
    active = mi.Bool(active)         # Active lanes

    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
        met = active & si.is_valid()
        transmittance = dr.select(met, transmittance * passes(si.bsdf(ray), si, met), transmittance)
        ray = towards(si, end)
        active = met & (dr.max(transmittance) != 0)
    return transmittance


def lone_channel(throughput: mi.Color3f) -> mi.Float:
    """1 + the only colour channel that a path's throughput has left, or 0 where there are more; dispersive glass
    follows that channel on from there. Rays hold it as their time, which scenes that do not move have no use for."""
    red, green, blue = (throughput[channel] != 0 for channel in range(3))
    found = dr.select(red & ~green & ~blue, mi.Float(1), 0)
    found = dr.select(green & ~red & ~blue, 2, found)
    return dr.select(blue & ~red & ~green, 3, found)


def balance(pdf: mi.Float, other: mi.Float) -> mi.Float:
    """Balance heuristic p / (p + q), and 1 where the other technique cannot make the sample (Veach 1997, equation
    9.8)."""
    return dr.select(other > 0, pdf / (pdf + other), 1)
