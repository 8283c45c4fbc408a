"""What all legs of a light path share: the scene, its limits, and emitter samples through panes, gaps and fog."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.first_hit import COSINE_SHARE, transparency
from dataset_builder.rendering.transport.fog import Fog
from dataset_builder.rendering.transport.portals import Portals

Passes = Callable[["mi.BSDFPtr", "mi.SurfaceInteraction3f", "mi.Bool"], "mi.Color3f"]
Towards = Callable[["mi.Interaction3f", "mi.Point3f"], "mi.Ray3f"]

EVERYTHING = frozenset({"image", "shading", "specular", "air"})
"""All that can be wanted of a path."""


class World:
    """A scene as paths see it. What is switched off leaves no trace in a kernel.

    max_depth: edges of the longest path. rr_depth: where Russian roulette starts. fog: None for clear air.
    portals: what samples of the dome, which the scene then has, go through; None for all round. wanted: what paths are
    followed for, some of EVERYTHING.
    """

    def __init__(self, scene: mi.Scene, max_depth: mi.UInt32, rr_depth: mi.UInt32, features: frozenset[str],
                 fog: Fog | None, portals: Portals | None = None, wanted: frozenset[str] = EVERYTHING):
        self.scene, self.max_depth, self.rr_depth = scene, max_depth, rr_depth
        self.fog, self.portals = fog, portals
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
        self.nested = "nested" in features
        """Whether bodies of glass may lie in each other."""
        self.dome_probability = mi.Float(0) if portals is None else _probability(scene, scene.environment())
        """With which a light sample is one of the dome, where there are portals."""
        self.wanted = wanted
        """What paths are followed for."""
        self.image, self.shading = wanted != {"shading"}, "shading" in wanted
        """Whether paths serve the image or parts of it, and whether they serve shading."""
        self.cosine_share = COSINE_SHARE if self.image and self.shading else float(self.shading)
        """Probability of the cosine lobe at the first hit: where paths serve one of the two alone, its own lobe."""


def _probability(scene: mi.Scene, emitter: mi.Emitter) -> mi.Float:
    """With which a light sample is one of an emitter."""
    return scene.pdf_emitter(dr.opaque(mi.UInt32, list(scene.emitters()).index(emitter)))


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
    if world.portals is None:
        ds, weight = world.scene.sample_emitter_direction(point, sample, not world.straight, active)
    else:
        ds, weight = _through_portals(world, world.portals, point, sample, active)
    if world.straight:
        weight = weight * straight_on(world.scene, point, ds.p, transparency, active & (ds.pdf != 0))
    if world.fog is not None:
        weight = weight * world.fog.transmittance(world.fog.segment(point.p, ds.d, ds.dist))
    return ds, weight


def _through_portals(world: World, portals: Portals, point: mi.Interaction3f, sample: mi.Point2f,
                     active: mi.Bool) -> tuple[mi.DirectionSample3f, mi.Color3f]:
    """As `Scene.sample_emitter_direction`, with samples of the dome drawn from `Portals.mixed`."""
    scene, dome = world.scene, world.scene.environment()
    index, per_emitter, rest = scene.sample_emitter(sample.x, active)
    emitter = dr.gather(mi.EmitterPtr, scene.emitters_dr(), index, active)
    outside = active & (emitter == mi.EmitterPtr(dome))

    # A direction through a portal, or all round
    all_round = rest < portals.share
    rest = dr.select(outside, dr.select(all_round, rest / portals.share, (rest - portals.share) / (1 - portals.share)),
                     rest)
    sample = mi.Point2f(dr.minimum(rest, dr.one_minus_epsilon(mi.Float)), sample.y)
    direction, solid_angle = portals.draw(point.p, sample, outside)
    ds, weight = emitter.sample_direction(point, sample, active)
    through = outside & ~all_round & (solid_angle > 0)
    ds.d = dr.select(through, direction, ds.d)
    ds.p = dr.select(through, dr.fma(direction, ds.dist, point.p), ds.p)
    ds.n = dr.select(through, -direction, ds.n)

    # Radiance over the density of the mixture
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi, si.wavelengths = -ds.d, point.wavelengths
    own = dome.pdf_direction(point, ds, outside)
    ds.pdf = dr.select(outside, portals.mixed(point.p, ds.d, solid_angle, own, 1, outside), ds.pdf)
    weight = dr.select(outside, dome.eval(si, outside) * dr.rcp(ds.pdf), weight)
    ds.pdf /= per_emitter
    weight *= per_emitter

    # What stands between
    active = active & (ds.pdf != 0)
    if not world.straight:
        active &= ~scene.ray_test(point.spawn_ray_to(ds.p), coherent=False, active=active)
        ds.pdf = dr.select(active, ds.pdf, 0)
    return ds, dr.select(active, weight, 0)


def emitter_pdf(world: World, point: mi.Interaction3f, ds: mi.DirectionSample3f, active: mi.Bool) -> mi.Float:
    """The density with which `sample_emitter` at a point draws the direction of `ds`, per steradian."""
    pdf = world.scene.pdf_emitter_direction(point, ds, active)
    if world.portals is None:
        return pdf
    outside = active & (ds.emitter == mi.EmitterPtr(world.scene.environment()))
    solid_angle = world.portals.solid_angle(point.p, outside)
    mixed = world.portals.mixed(point.p, ds.d, solid_angle, pdf, world.dome_probability, outside)
    return dr.select(outside, mixed, pdf)


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


def balance(pdf: mi.Float, other: mi.Float) -> mi.Float:
    """Balance heuristic p / (p + q), and 1 where the other technique cannot make the sample (Veach 1997, equation
    9.8)."""
    return dr.select(other > 0, pdf / (pdf + other), 1)
