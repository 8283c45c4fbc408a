"""Lamps as light paths see them: which there are, how many paths each sends, a ray with its flux, and its density.

A lamp sends its paths from even points of its surface in directions about its normal in proportion to the cosine, a
point from its place evenly over the sphere, a spot evenly over its cone. Lights outside the scene send none. Where
there are caustics, some paths are aimed at what throws them, see `aim`. With p(y0) a lamp's density over its area and
p(d) over directions, paths have the density

    a = share p(y0) p(d) / cos        of a surface, cos that of d and the normal: share / (pi area) without aim
    a = share p(d)                    of a lamp without a size: share / solid angle without aim

share the lamp's share of the paths, so that a path has the flux L / a of all that are sent, L the radiance or intensity
along d.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.errors import PlanError
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.transport.aim import NONE, Aim, Outlook, aimed, take_aim

LUMINANCE = np.array([0.2126390059, 0.7151686788, 0.0721923154])
"""Of the Rec.709 primaries."""
ROW, BEAM = 2, 4
"""Floats of a lamp: `a` and `lone` of `Beginning`; and of its beam if it has no size: axis, cosine of the
widest angle."""


class Lamps:
    """L lamps that send light paths, on the device; a plain class, which loops do not take for their state."""

    def __init__(self, *, numbers: np.ndarray, rows: np.ndarray, emission: np.ndarray, paths: np.ndarray,
                 beams: np.ndarray, aim: Aim | None):
        """numbers: (L,) of their emitters. rows: (L, ROW). emission: a by number of an emitter. paths: (L,). beams:
        (N, BEAM) by number of an emitter. aim: None where no paths are aimed."""
        self.pointer, self.rows = owned(mi.UInt32, numbers), owned(mi.Float, rows)
        self.emission = owned(mi.Float, emission)
        """a without aim; 0 for what sends no paths."""
        self.paths = paths
        """How many each sends in a set."""
        self.aim = aim
        self.beams = owned(mi.Float, beams) if aim else None

    def emitted(self, point: mi.Interaction3f, light: mi.DirectionSample3f, active: mi.Bool) -> mi.Float:
        """a of a light seen from a point, in the units of `weights`: divided by the squared distance where the lamp has
        no size."""
        number = dr.reinterpret_array(mi.UInt32, light.emitter)
        a = dr.gather(mi.Float, self.emission, number, active)
        if self.aim is not None:
            outlook = self.outlook(number, light.p, light.n, light.delta, active)
            a = self.density(self.aim, number, outlook, -light.d, mi.UInt32(NONE), active)
        return a * dr.select(light.delta, dr.rcp(dr.squared_norm(light.p - point.p)), 1)

    def density(self, aim: Aim, number: mi.UInt32, outlook: Outlook, direction: mi.Vector3f, sphere: mi.UInt32,
                active: mi.Bool) -> mi.Float:
        """a of a path from an emitter along a unit direction. sphere: see `aim.aimed`."""
        own = dr.gather(mi.Float, self.emission, number, active)
        share, towards = aimed(aim, outlook, direction, sphere, active & (own > 0))
        cos = dr.select(outlook.lone, 1, dr.dot(outlook.axis, direction))
        solid = dr.select(outlook.lone, dr.two_pi * (1 - outlook.limit), dr.pi)
        return own * (1 - share + dr.select(cos > 0, towards * solid / cos, 0))

    def outlook(self, number: mi.UInt32, p: mi.Point3f, n: mi.Normal3f, lone: mi.Bool, active: mi.Bool) -> Outlook:
        """A place on an emitter, for `aim`. n: normal, of no use where the lamp has no size."""
        beam = dr.gather(mi.Vector4f, self.beams, number, active)
        axis = dr.select(lone, mi.Vector3f(beam.x, beam.y, beam.z), mi.Vector3f(n))
        return Outlook(p=p, axis=axis, limit=dr.select(lone, beam.w, 0), lone=lone)


@dataclass
class Beginning:
    """Where on its lamp a light path began."""

    p: mi.Point3f
    n: mi.Normal3f
    uv: mi.Point2f
    emitter: mi.UInt32
    """Number of the lamp's emitter."""
    a: mi.Float
    """Density of the path, but for the distance where the lamp has no size."""
    lone: mi.Float
    """Probability that a light sample takes a lamp without a size; 0 for others."""

    def seen_from(self, point: mi.Point3f) -> mi.DirectionSample3f:
        """What a light sample at a point would be that found this place; its density is left open."""
        way = self.p - point
        distance = dr.norm(way)
        return mi.DirectionSample3f(self.p, self.n, self.uv, mi.Float(0), mi.Float(0), self.lone > 0, way / distance,
                                    distance, dr.reinterpret_array(mi.EmitterPtr, self.emitter))


@dataclass
class Emission:
    """How a light path sets out."""

    ray: mi.Ray3f
    flux: mi.Color3f
    """In watts, as if the path were its set: their mean over a set is what its lamps send."""
    begin: Beginning


def lamps_of(scene: mi.Scene, paths: int, casters: np.ndarray | None = None) -> Lamps:
    """The lamps of a scene, which send a set of `paths` in proportion to their flux; one that would send less than half
    a path sends none. casters: (K, 4) spheres that paths are aimed at, see `aim`; None for kernels that do not aim.
    Raises PlanError where nothing in it sends light paths."""
    found = [(index, emitter) for index, emitter in enumerate(scene.emitters()) if _sends(emitter)]
    if not found:
        raise PlanError("transport: expected a lamp that sends light for joined paths, got none")
    power = np.array([_power(emitter) for _, emitter in found])
    ends = np.rint(np.cumsum(power) / power.sum() * paths).astype(np.int64)
    sent = np.diff(ends, prepend=0)
    shares, rows = sent / paths, np.zeros((len(found), ROW), dtype=np.float32)
    numbers = np.array([_number(emitter) for _, emitter in found], dtype=np.uint32)
    emission = np.zeros(_power_of_two(max(_number(emitter) for emitter in scene.emitters()) + 1), dtype=np.float32)
    beams = np.zeros((len(emission), BEAM), dtype=np.float32)
    for k, (index, emitter) in enumerate(found):
        size, solid = _extent(emitter)
        emission[numbers[k]] = shares[k] / (pi * size if size else solid)
        lone = 0.0 if size else float(np.array(scene.pdf_emitter(mi.UInt32(index))).ravel()[0])
        rows[k] = emission[numbers[k]], lone
        beams[numbers[k]] = *_axis(emitter), 1 - solid / (2 * pi)
    return Lamps(numbers=numbers, rows=rows, emission=emission, paths=sent, beams=beams,
                 aim=None if casters is None else Aim(casters))


def emit(lamps: Lamps, lamp: mi.UInt32, flux: mi.Float, sample1: mi.Point2f, sample2: mi.Point2f) -> Emission:
    """A ray from the lamp of each lane. flux: 1 / share of the lane's lamp."""
    number = dr.gather(mi.UInt32, lamps.pointer, lamp)
    emitter = dr.reinterpret_array(mi.EmitterPtr, number)
    a, lone = (dr.gather(mi.Float, lamps.rows, lamp * ROW + k) for k in (0, 1))
    sized = lone == 0

    # From a surface: L pi A
    place = emitter.get_shape().sample_position(0, sample1, sized)
    if lamps.aim is not None:
        return _aimed(lamps, lamps.aim, number, place, lone, sample1, sample2)
    surface = mi.SurfaceInteraction3f(place, dr.zeros(mi.Color0f))
    local = mi.warp.square_to_cosine_hemisphere(sample2)
    surface.wi = local
    sent = emitter.eval(surface, sized) * (dr.pi / place.pdf)

    # From a point
    ray, weight = emitter.sample_ray(0, 0, sample1, sample2, ~sized)
    ray = dr.select(sized, surface.spawn_ray(mi.Frame3f(place.n).to_world(local)), ray)
    begin = Beginning(p=dr.select(sized, place.p, ray.o), n=place.n, uv=place.uv, emitter=number, a=a, lone=lone)
    return Emission(ray=ray, flux=mi.Color3f(dr.select(sized, sent, weight)) * flux, begin=begin)


def _aimed(lamps: Lamps, aim: Aim, number: mi.UInt32, place: mi.PositionSample3f, lone: mi.Float, sample1: mi.Point2f,
           sample2: mi.Point2f) -> Emission:
    """`emit` where some paths are aimed: flux L / a. place: on the lamp's surface, if it has one."""
    emitter, sized, all_lanes = dr.reinterpret_array(mi.EmitterPtr, number), lone == 0, mi.Bool(True)
    place.p = dr.select(sized, place.p, emitter.sample_ray(0, 0, sample1, sample2, ~sized)[0].o)
    outlook = lamps.outlook(number, place.p, place.n, ~sized, all_lanes)
    sphere, direction, own = take_aim(aim, outlook, sample2)
    cosine = mi.Frame3f(place.n).to_world(mi.warp.square_to_cosine_hemisphere(own))
    spread = emitter.sample_ray(0, 0, sample1, own, ~sized)[0].d
    direction = dr.select(sphere == NONE, dr.select(sized, cosine, spread), direction)

    # Radiance of a surface; intensity of a point, as seen from a distance of one
    surface = mi.SurfaceInteraction3f(place, dr.zeros(mi.Color0f))
    surface.wi = surface.to_local(direction)
    seen = dr.zeros(mi.Interaction3f)
    seen.p = place.p + direction
    radiance = dr.select(sized, emitter.eval(surface, sized), emitter.sample_direction(seen, sample1, ~sized)[1])
    a = lamps.density(aim, number, outlook, direction, sphere, all_lanes)
    begin = Beginning(p=place.p, n=place.n, uv=place.uv, emitter=number, a=a, lone=lone)
    ray = dr.select(sized, surface.spawn_ray(direction), mi.Ray3f(place.p, direction))
    return Emission(ray=ray, flux=mi.Color3f(radiance) / a, begin=begin)


def _sends(emitter: mi.Emitter) -> bool:
    flags = emitter.flags()
    outside = mi.has_flag(flags, mi.EmitterFlags.Infinite) or mi.has_flag(flags, mi.EmitterFlags.DeltaDirection)
    return not outside and _brightness(emitter) > 0 and _sampled(emitter)


def _sampled(emitter: mi.Emitter) -> bool:
    return float(emitter.sampling_weight()) > 0


def _brightness(emitter: mi.Emitter) -> float:
    """Luminance of its radiance or intensity, on average over its texels."""
    params = mi.traverse(emitter)
    name = next(name for name in dict(params) if name.startswith(("radiance.", "intensity."))
                and name.rpartition(".")[2] in ("value", "data"))
    texels = np.asarray(params[name], dtype=np.float64).reshape(-1)
    colour = texels.reshape(-1, 3).mean(axis=0) if texels.size % 3 == 0 else np.repeat(texels.mean(), 3)
    return float(colour @ LUMINANCE)


def _extent(emitter: mi.Emitter) -> tuple[float, float]:
    """(area, 0) of a surface, (0, solid angle) of a lamp without a size."""
    if (shape := emitter.get_shape()) is not None:
        return float(np.array(shape.surface_area()).ravel()[0]), 0.0
    params = mi.traverse(emitter)
    cutoff = float(np.array(params["cutoff_angle"]).ravel()[0]) if "cutoff_angle" in params else 180.0
    return 0.0, 2 * pi * (1 - cos(radians(cutoff)))


def _axis(emitter: mi.Emitter) -> np.ndarray:
    """(3,) unit axis of a spot; of no use for others."""
    params = mi.traverse(emitter)
    if "cutoff_angle" not in params:
        return np.array([0.0, 0, 1])
    axis = np.array(params["to_world"].matrix, dtype=np.float64).reshape(4, 4)[:3, 2]
    return axis / np.linalg.norm(axis)


def _power(emitter: mi.Emitter) -> float:
    """Flux, that of a spot as if it were even over its cone."""
    size, solid = _extent(emitter)
    return _brightness(emitter) * (pi * size or solid)


def _number(emitter: mi.Emitter) -> int:
    return int(np.array(dr.reinterpret_array(mi.UInt32, mi.EmitterPtr(emitter))).ravel()[0])


def _power_of_two(count: int) -> int:
    return 1 << max(count - 1, 0).bit_length()
