"""Lamps as light paths see them: which there are, how many paths each sends, a ray with its flux, and its density.

A lamp sends its paths from even points of its surface in directions about its normal in proportion to the cosine, a
point from its place evenly over the sphere, a spot evenly over its cone. Lights outside the scene send none.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.errors import PlanError
from dataset_builder.rendering.buffers import owned

LUMINANCE = np.array([0.2126390059, 0.7151686788, 0.0721923154])
"""Of the Rec.709 primaries."""
ROW = 2
"""Floats of a lamp: `a` and `lone` of `Beginning`."""


class Lamps:
    """L lamps that send light paths, on the device; a plain class, which loops do not take for their state."""

    def __init__(self, *, numbers: np.ndarray, rows: np.ndarray, emission: np.ndarray, paths: np.ndarray):
        """numbers: (L,) of their emitters. rows: (L, ROW). emission: a by number of an emitter. paths: (L,)."""
        self.pointer, self.rows = owned(mi.UInt32, numbers), owned(mi.Float, rows)
        self.emission = owned(mi.Float, emission)
        """a = share / (pi area), or share / solid angle for a lamp without a size; 0 for what sends no paths."""
        self.paths = paths
        """How many each sends in a set."""

    def emitted(self, point: mi.Interaction3f, light: mi.DirectionSample3f, active: mi.Bool) -> mi.Float:
        """a of a light seen from a point, in the units of `weights`: divided by the squared distance where the lamp has
        no size."""
        a = dr.gather(mi.Float, self.emission, dr.reinterpret_array(mi.UInt32, light.emitter), active)
        return a * dr.select(light.delta, dr.rcp(dr.squared_norm(light.p - point.p)), 1)


@dataclass
class Beginning:
    """Where on its lamp a light path began."""

    p: mi.Point3f
    n: mi.Normal3f
    uv: mi.Point2f
    emitter: mi.UInt32
    """Number of the lamp's emitter."""
    a: mi.Float
    """See `Lamps.emission`."""
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
    """Of one path of a set, in watts: their sum over a set is what its lamps send."""
    begin: Beginning


def lamps_of(scene: mi.Scene, paths: int) -> Lamps:
    """The lamps of a scene, which send a set of `paths` in proportion to their flux; one that would send less than half
    a path sends none. Raises PlanError where nothing in it sends light paths."""
    found = [(index, emitter) for index, emitter in enumerate(scene.emitters()) if _sends(emitter)]
    if not found:
        raise PlanError("transport: expected a lamp that sends light for joined paths, got none")
    power = np.array([_power(emitter) for _, emitter in found])
    ends = np.rint(np.cumsum(power) / power.sum() * paths).astype(np.int64)
    sent = np.diff(ends, prepend=0)
    shares, rows = sent / paths, np.zeros((len(found), ROW), dtype=np.float32)
    numbers = np.array([_number(emitter) for _, emitter in found], dtype=np.uint32)
    emission = np.zeros(_power_of_two(max(_number(emitter) for emitter in scene.emitters()) + 1), dtype=np.float32)
    for k, (index, emitter) in enumerate(found):
        size, solid = _extent(emitter)
        emission[numbers[k]] = shares[k] / (pi * size if size else solid)
        lone = 0.0 if size else float(np.array(scene.pdf_emitter(mi.UInt32(index))).ravel()[0])
        rows[k] = emission[numbers[k]], lone
    return Lamps(numbers=numbers, rows=rows, emission=emission, paths=sent)


def emit(lamps: Lamps, lamp: mi.UInt32, flux: mi.Float, sample1: mi.Point2f, sample2: mi.Point2f) -> Emission:
    """A ray from the lamp of each lane. flux: 1 / (paths of the lane's lamp in its set)."""
    number = dr.gather(mi.UInt32, lamps.pointer, lamp)
    emitter = dr.reinterpret_array(mi.EmitterPtr, number)
    a, lone = (dr.gather(mi.Float, lamps.rows, lamp * ROW + k) for k in (0, 1))
    sized = lone == 0

    # From a surface: L pi A
    place = emitter.get_shape().sample_position(0, sample1, sized)
    surface = mi.SurfaceInteraction3f(place, dr.zeros(mi.Color0f))
    local = mi.warp.square_to_cosine_hemisphere(sample2)
    surface.wi = local
    sent = emitter.eval(surface, sized) * (dr.pi / place.pdf)

    # From a point
    ray, weight = emitter.sample_ray(0, 0, sample1, sample2, ~sized)
    ray = dr.select(sized, surface.spawn_ray(mi.Frame3f(place.n).to_world(local)), ray)
    begin = Beginning(p=dr.select(sized, place.p, ray.o), n=place.n, uv=place.uv, emitter=number, a=a, lone=lone)
    return Emission(ray=ray, flux=mi.Color3f(dr.select(sized, sent, weight)) * flux, begin=begin)


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


def _power(emitter: mi.Emitter) -> float:
    """Flux, that of a spot as if it were even over its cone."""
    size, solid = _extent(emitter)
    return _brightness(emitter) * (pi * size or solid)


def _number(emitter: mi.Emitter) -> int:
    return int(np.array(dr.reinterpret_array(mi.UInt32, mi.EmitterPtr(emitter))).ravel()[0])


def _power_of_two(count: int) -> int:
    return 1 << max(count - 1, 0).bit_length()
