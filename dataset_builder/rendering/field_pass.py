"""The pass that sees an object through its field: the field's image at the camera of the view, and its opacity."""

from __future__ import annotations

from functools import partial
from itertools import product

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.planning.scene.assets_of_plan import world_from_object
from dataset_builder.rendering.field.seen import look_of
from dataset_builder.rendering.pass_inputs import sky_radiance
from dataset_builder.rendering.sampling.adaptive import Sample
from dataset_builder.rendering.sampling.estimate import Samplers
from dataset_builder.rendering.view_scenes import ViewScenes, covered_window
from dataset_builder.rendering.view_sensor import primary_ray

OPACITY = slice(3, 4)
"""Channel after the three of radiance."""


def field_window(scenes: ViewScenes) -> np.ndarray:
    """Pixels that the cube of the view's field may cover, indices row * width + column."""
    file, world = scenes.field(scenes.plan.field), world_from_object(scenes.plan.target)
    corners = np.array(file.centre) + file.radius * np.array([*product((-1.0, 1.0), repeat=3)])
    points = scenes.local_frame.points(corners @ world[:3, :3].T + world[:3, 3])
    return covered_window(Pinhole.of(scenes.view.camera, scenes.plan.render.width, scenes.plan.render.height), points)


def field_sampler(scenes: ViewScenes) -> Sample:
    """Sampler of the field's image: radiance (premultiplied by opacity), then opacity, four channels.

    The light is the field's own. A capture, whose light nobody knows, is scaled so that white paper has the radiance
    that the spec's source light gives it.
    """
    file, view = scenes.field(scenes.plan.field), scenes.view
    look, sensor = look_of(file), view.sensor()
    placed, frame = world_from_object(scenes.plan.target), scenes.local_frame
    # From the frame of the passes to that of the object
    turn = placed[:3, :3].T
    origin = turn @ (np.array(frame.origin) - placed[:3, 3])
    rows = [mi.Vector3f(*(dr.opaque(mi.Float, value) for value in row)) for row in turn.tolist()]
    moved = mi.Vector3f(*(dr.opaque(mi.Float, value) for value in origin.tolist()))
    unit = dr.opaque(mi.Float, frame.unit)
    gain = dr.opaque(mi.Float, sky_radiance(scenes.plan) / file.white)

    def integrand(samplers: Samplers, position: mi.Vector2f) -> list[mi.Float]:
        ray = primary_ray(sensor, position)
        start, way = (mi.Vector3f(*(dr.dot(row, vector) for row in rows)) for vector in (mi.Vector3f(ray.o), ray.d))
        colour, opacity = look(mi.Point3f(start * unit + moved), way, mi.Bool(True))
        return [*(colour * gain), opacity]

    return partial(view.estimate, integrand)
