"""Passes by joined paths: light paths for every independent group of samples, and the integrand joined with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.scene_plan import IlluminationPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.caustic_error import paths_for
from dataset_builder.rendering.sampling.estimate import Elsewhere, Groups, Integrand, Samplers, Shared
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.transport.joined_paths import LightSide, trace_joined
from dataset_builder.rendering.transport.lamps import Lamps, lamps_of
from dataset_builder.rendering.transport.light_image import Camera, light_image
from dataset_builder.rendering.transport.light_paths import LightVertices, trace_light
from dataset_builder.rendering.transport.light_sampling import World
from dataset_builder.rendering.transport.links import table_of
from dataset_builder.rendering.transport.side_by_side import beside
from dataset_builder.rendering.view_sensor import ViewSensor, primary_ray
from dataset_builder.seeding import derive_seed


@dataclass(frozen=True, kw_only=True)
class InStep:
    """That a pass is compared with others, sample by sample."""

    other: Mapping[int, LightVertices] = field(default_factory=dict)
    """Light vertices of the scene that it is compared with, by seed of their groups; none where these are not held
    against each other."""


def light_paths(view: ViewSensor, opened: OpenScene, max_depth: int, caustics: bool, wanted: Sequence[str],
                groups: Sequence[Groups]) -> dict[int, LightVertices]:
    """The light vertices that joined paths of a scene would be joined with, by seed of their groups."""
    world, lamps = _world(view, opened, max_depth, wanted), _lamps(opened, caustics)
    return {each.seed: _vertices(world, lamps, each, caustics) for each in groups}


def joined_integrand(view: ViewSensor, opened: OpenScene, max_depth: int, caustics: bool, wanted: Sequence[str],
                     in_step: InStep | None = None) -> Shared:
    """What `radiance_sampler` samples, by joined paths; see `sampling.estimate.Shared`. wanted: channels in their
    order."""
    sensor, camera = view.sensor(), camera_of(view)
    world, lamps = _world(view, opened, max_depth, wanted), _lamps(opened, caustics)
    share = dr.opaque(mi.Float, lamp_share(opened.illumination) if opened.illumination else 0.0)

    def shared(groups: Groups) -> tuple[Integrand, Elsewhere | None]:
        """Light paths of the groups, and what is joined with them."""
        paths = paths_for(groups.samples, caustics)
        vertices = _vertices(world, lamps, groups, caustics)
        linked = beside(vertices, in_step.other[groups.seed]) if in_step and in_step.other else vertices
        light = LightSide(lamps(paths), table_of(linked), mi.ShapePtr(opened.shape), share,
                          dr.opaque(mi.Float, paths / groups.per_pixel if caustics else 0.0))

        def integrand(samplers: Samplers, position: mi.Vector2f) -> list[mi.Float]:
            ray = primary_ray(sensor, position)
            found = trace_joined(world, light, samplers.strata, samplers.rest, ray, camera.pixel_pdf(ray.d),
                                 samplers.group, derive_seed(samplers.seed, "rest") & 0xFFFFFFFF,
                                 in_step=in_step is not None)
            return [channel for name in wanted for channel in found.channels(name)]

        def elsewhere(pixels: np.ndarray, numbers: np.ndarray) -> np.ndarray:
            return light_image(world, light, camera, vertices, pixels, numbers, wanted)

        return integrand, elsewhere if caustics else None

    return shared


def _world(view: ViewSensor, opened: OpenScene, max_depth: int, wanted: Sequence[str]) -> World:
    longest, roulette = (dr.opaque(mi.UInt32, depth) for depth in (max_depth, view.render.rr_depth))
    traced = frozenset(name.removesuffix("_squared") for name in wanted)
    return World(opened.scene, longest, roulette, opened.features, opened.fog, opened.portals, traced)


def _lamps(opened: OpenScene, caustics: bool) -> Callable[[int], Lamps]:
    """By light paths of a set."""
    return cache(lambda paths: lamps_of(opened.scene, paths, opened.body.casters if caustics else None))


def _vertices(world: World, lamps: Callable[[int], Lamps], groups: Groups, caustics: bool) -> LightVertices:
    return trace_light(world, lamps(paths_for(groups.samples, caustics)), sets=groups.count,
                       seed=derive_seed(groups.seed, "light"))


def camera_of(view: ViewSensor) -> Camera:
    """The camera as light paths see it."""
    pinhole = Pinhole.of(view.camera, view.render.width, view.render.height)
    eye, forward = mi.Point3f(pinhole.position.tolist()), mi.Vector3f(pinhole.basis[2].tolist())
    dr.make_opaque(eye, forward)
    return Camera(pinhole=pinhole, eye=eye, forward=forward, pixel_area=dr.opaque(mi.Float, pinhole.focal**-2))


def lamp_share(illumination: IlluminationPlan) -> float:
    """Share of the light at the object that comes from lamps."""
    total = sum(light.weight for light in illumination.lights)
    lamps = sum(light.weight for light in illumination.lights if not LIGHT_KINDS[light.kind].outside)
    return lamps / total if total else 0.0
