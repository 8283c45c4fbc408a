"""What all legs of a light path share: the scene, its limits, and light samples that see through panes and fog."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.first_hit import transparency
from dataset_builder.rendering.transport.fog import Fog


class World:
    """A scene as paths see it. max_depth: edges of the longest path; rr_depth: where Russian roulette starts.

    glass, thin: whether kernels handle refracting bodies and panes that light passes straight; dispersion: whether
    glass spreads colours; fog: None for clear air. What is switched off leaves no trace in a kernel.
    """

    def __init__(self, scene: mi.Scene, max_depth: mi.UInt32, rr_depth: mi.UInt32, features: frozenset[str],
                 fog: Fog | None):
        self.scene, self.max_depth, self.rr_depth = scene, max_depth, rr_depth
        self.glass, self.thin, self.fog = "glass" in features, "thin" in features, fog
        self.dispersion = "dispersion" in features


@dataclass
class Air:
    """What happens to a ray on its way to the next surface. transmittance: to that surface; collided: whether the fog
    scatters it before; point: where that is, or the surface."""

    transmittance: mi.Float
    collided: mi.Bool
    point: mi.Interaction3f


def cross_air(world: World, ray: mi.Ray3f, si: mi.SurfaceInteraction3f, sampler: mi.Sampler, active: mi.Bool) -> Air:
    """A random flight along a ray that meets `si`; nothing happens in clear air."""
    if world.fog is None:
        return Air(transmittance=mi.Float(1), collided=mi.Bool(False), point=si)
    way = world.fog.way(ray.o, ray.d, si.t)
    distance, collided = world.fog.flight(way, sampler.next_1d(active))
    point = dr.select(collided, in_air(ray, distance), mi.Interaction3f(si))
    return Air(transmittance=world.fog.transmittance(way), collided=collided, point=point)


def in_air(ray: mi.Ray3f, distance: mi.Float) -> mi.Interaction3f:
    """A point on a ray, away from any surface."""
    point = dr.zeros(mi.Interaction3f)
    point.t, point.p, point.time, point.wavelengths = distance, ray(distance), ray.time, ray.wavelengths
    return point


def sample_light(world: World, point: mi.Interaction3f, sample: mi.Point2f,
                 active: mi.Bool) -> tuple[mi.DirectionSample3f, mi.Color3f]:
    """A direction to a light, and the radiance that arrives from it over its density: Mitsuba's next event estimation,
    with what panes and fog let through."""
    ds, weight = world.scene.sample_emitter_direction(point, sample, not world.thin, active)
    if world.thin:
        weight = weight * _through_panes(world.scene, point, ds, active & (ds.pdf != 0))
    if world.fog is not None:
        weight = weight * world.fog.transmittance(world.fog.way(point.p, ds.d, ds.dist))
    return ds, weight


@dr.syntax
def _through_panes(scene: mi.Scene, point: mi.Interaction3f, ds: mi.DirectionSample3f, active: mi.Bool) -> mi.Color3f:
    """Share of light that comes straight from `ds` to `point` through whatever stands between; 0 behind what is
    opaque."""
    passed, active = mi.Color3f(1), mi.Bool(active)
    ray = point.spawn_ray_to(ds.p)
    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
        met = active & si.is_valid()
        passed = dr.select(met, passed * transparency(si.bsdf(ray), si, met), passed)
        ray = si.spawn_ray_to(ds.p)
        active = met & (dr.max(passed) != 0)
    return passed


def carried(weight: mi.Color3f) -> mi.Float:
    """1 + the only colour channel that a path's weight has left, or 0 where there are more; dispersive glass follows
    that channel on from there. Rays hold it as their time, which scenes that do not move have no use for."""
    one, two, three = (weight[channel] != 0 for channel in range(3))
    found = dr.select(one & ~two & ~three, mi.Float(1), 0)
    found = dr.select(two & ~one & ~three, 2, found)
    return dr.select(three & ~one & ~two, 3, found)


def balance(pdf: mi.Float, other: mi.Float) -> mi.Float:
    """Balance heuristic, and 1 where the other technique cannot make the sample (Veach 1997, equation 9.8)."""
    return dr.select(other > 0, pdf / (pdf + other), 1)
