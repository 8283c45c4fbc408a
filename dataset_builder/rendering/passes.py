"""The passes: each an integrand over a scene, and the layers its channels mean."""

from __future__ import annotations

from collections.abc import Mapping

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.label.example_plan import Transport
from dataset_builder.layers import LAYERS
from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE
from dataset_builder.rendering.joined import InStep, joined_integrand
from dataset_builder.rendering.sampling.adaptive import Sample
from dataset_builder.rendering.sampling.estimate import Samplers
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.surface.first_hit import reflectance
from dataset_builder.rendering.transport.integrator import trace
from dataset_builder.rendering.transport.sight import first_surface
from dataset_builder.rendering.view_sensor import CENTRE, ViewSensor, primary_ray

RADIANCE = ("image", "shading", "specular", "shading_squared", "air")
"""All that a radiance pass can find, three channels each, in their order."""
WANTED: Mapping[str, frozenset[str]] = {"source": frozenset({"image"}),
                                        "source_clean": frozenset({"image"}), "target": frozenset(RADIANCE),
                                        "rough": frozenset({"shading"}), "pbr": frozenset(RADIANCE),
                                        "empty": frozenset(RADIANCE)}
"""What each radiance pass is run for, by its layers and by the gates, which check the target pass as a whole. It is the
same for all examples: what a pass found can be shared without asking what for. Passes that are `layers.ALIKE` are run
for the same, since what is wanted decides which way a path goes from the first surface."""
RADIANCE_LAYERS = {"i_s": "image", "i_s_clean": "image", "i_t": "image", "s": "shading", "s_prime": "shading",
                   "spec": "specular", "air": "air", "i_t_empty": "image", "i_pbr": "image"}
"""Channels of a radiance pass that a layer takes."""
FIRST_HIT_CHANNELS = {"mask": slice(0, 1), "d": slice(1, 4), "r": slice(4, 7), "normal": slice(7, 10),
                      "depth": slice(10, 11), "met": slice(11, 12), "d_squared": slice(12, 15)}


def channels_of(wanted: frozenset[str]) -> Mapping[str, slice]:
    """Where the channels are of what is wanted of a radiance pass; of nothing else."""
    there = [name for name in RADIANCE if name in wanted]
    return {name: slice(3 * place, 3 * place + 3) for place, name in enumerate(there)}


RADIANCE_CHANNELS = channels_of(frozenset(RADIANCE))
"""Those of a pass that is run for everything."""


def radiance_channels(layer: str) -> slice:
    """Channels that a layer takes of its pass. Raises KeyError where the pass is not run for it."""
    return channels_of(WANTED[LAYERS[layer].render_pass])[RADIANCE_LAYERS[layer]]


def radiance_sampler(view: ViewSensor, opened: OpenScene, max_depth: int, transport: Transport = "camera",
                     caustics: bool = False, wanted: frozenset[str] = frozenset(RADIANCE),
                     in_step: InStep | None = None) -> Sample:
    """Sampler of what is `wanted` of RADIANCE, channels as `channels_of` cuts them; nothing else is computed. in_step:
    for joined paths that are compared with those of another scene; camera paths are in step as they are."""
    names = [name for name in RADIANCE if name in wanted and (name != "air" or opened.fog)]
    if transport == "joined":
        shared = joined_integrand(view, opened, max_depth, caustics, names, in_step)
        return lambda pixels, spp, batches, seed: view.estimate_shared(shared, pixels, spp, batches,
                                                                       seed).padded(3 * len(wanted))
    sensor, traced = view.sensor(), frozenset(name.removesuffix("_squared") for name in wanted)
    longest, roulette = (dr.opaque(mi.UInt32, depth) for depth in (max_depth, view.render.rr_depth))

    def integrand(samplers: Samplers, position: mi.Vector2f) -> list[mi.Float]:
        found = trace(opened.scene, samplers.strata, samplers.rest, primary_ray(sensor, position), longest, roulette,
                      features=opened.features, fog=opened.fog, portals=opened.portals, wanted=traced)
        return [channel for name in names for channel in found.channels(name)]

    def sample(pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
        return view.estimate(integrand, pixels, spp, batches, seed).padded(3 * len(wanted))

    return sample


def radiance(view: ViewSensor, opened: OpenScene, pixels: np.ndarray, *, max_depth: int, spp: int, seed: int,
             transport: Transport = "camera", wanted: frozenset[str] = frozenset(RADIANCE)) -> Estimate:
    """What `radiance_sampler` samples with caustics, at a fixed spp."""
    sample = radiance_sampler(view, opened, max_depth, transport, caustics=True, wanted=wanted)
    return sample(pixels, spp, view.render.batches, seed)


def first_hit(view: ViewSensor, opened: OpenScene, pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
    """The light-free layers, channels as `FIRST_HIT_CHANNELS` cuts them: means over all samples, hits or not."""
    sensor = view.sensor()
    forward = mi.Vector3f(sensor.world_transform() @ mi.Vector3f(0, 0, 1))
    origin = mi.Point3f(sensor.world_transform() @ mi.Point3f(0, 0, 0))
    dr.make_opaque(forward, origin)

    def integrand(samplers: Samplers, position: mi.Vector2f) -> list[mi.Float]:
        ray, si = _beyond_lamps(opened, primary_ray(sensor, position), samplers)
        met = si.is_valid()
        diffuse, specular, normal = reflectance(si.bsdf(ray), si, met)
        target = met & (_instance(opened, si) == TARGET_INSTANCE)
        depth = dr.dot(si.p - origin, forward)
        channels = [dr.select(target, mi.Float(1), 0), *diffuse, *specular, *si.to_world(normal), depth, mi.Float(1),
                    *(diffuse * diffuse)]
        return [channels[0], *(dr.select(met, channel, 0) for channel in channels[1:])]

    return view.estimate(integrand, pixels, spp, batches, seed)


def instances(view: ViewSensor, opened: OpenScene, pixels: np.ndarray) -> np.ndarray:
    """(P,) instance that the ray through each pixel's centre meets; 0 for none. Past what is there in part it is that
    where half of the sight has ended."""
    sensor = view.sensor()
    size = mi.Vector2f(dr.opaque(mi.Float, view.render.width), dr.opaque(mi.Float, view.render.height))
    row, column = np.divmod(pixels, view.render.width)
    centre = mi.Vector2f(mi.Float(column + CENTRE), mi.Float(row + CENTRE)) / size
    _, si = _beyond_lamps(opened, primary_ray(sensor, centre), None)
    return np.array(dr.select(si.is_valid(), _instance(opened, si), 0))


def first_hit_layers(found: Estimate) -> Mapping[str, np.ndarray]:
    """(P, C) layers of a first-hit pass: depth is the mean over samples that met something."""
    mean = {name: found.mean[:, channels] for name, channels in FIRST_HIT_CHANNELS.items()}
    met = np.maximum(mean["met"], 1e-12)
    return {name: mean[name] for name in ("mask", "d", "r", "normal")} | {"depth": mean["depth"] / met}


def deviation(found: Estimate, channels: Mapping[str, slice], name: str) -> np.ndarray:
    """(P, 3) deviation over the samples of each pixel of `name`, of which the pass also has the mean of squares."""
    mean, squared = found.mean[:, channels[name]], found.mean[:, channels[f"{name}_squared"]]
    return np.sqrt(np.maximum(squared - mean**2, 0))


def _beyond_lamps(opened: OpenScene, ray: mi.Ray3f,
                  samplers: Samplers | None) -> tuple[mi.Ray3f, mi.SurfaceInteraction3f]:
    """What `sight.first_surface` finds of the body: the shapes of lamps are no surfaces, so that a lamp in the picture
    hides nothing in the light-free layers. Without samplers, where half of the sight has ended."""
    choice = None
    if "coverage" in opened.features:
        choice = dr.opaque(mi.Float, CENTRE) if samplers is None else samplers.strata.next_1d()
    return first_surface(opened.scene, ray, mi.ShapePtr(opened.shape), choice, mi.Bool(True))


def _instance(opened: OpenScene, si: mi.SurfaceInteraction3f) -> mi.UInt32:
    """Instance of the face that was met; lamps are no instance."""
    own = si.shape == mi.ShapePtr(opened.shape)
    return dr.select(own, dr.gather(mi.UInt32, opened.body.instance, si.prim_index, own), 0)
