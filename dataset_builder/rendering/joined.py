"""Passes by joined paths: light paths for every independent group of samples, and the integrand that is joined with them.
"""

from math import log2, tan, radians

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.label.scene_plan import IlluminationPlan
from dataset_builder.rendering.sampling.estimate import Groups, Integrand, Samplers, Shared
from dataset_builder.rendering.scene.open_scene import OpenScene
from dataset_builder.rendering.transport.joined_paths import LightSide, trace_joined
from dataset_builder.rendering.transport.lamps import lamps_of
from dataset_builder.rendering.transport.light_paths import trace_light
from dataset_builder.rendering.transport.light_sampling import World
from dataset_builder.rendering.transport.links import table_of
from dataset_builder.rendering.view_sensor import ViewSensor, primary_ray
from dataset_builder.seeding import derive_seed

SAMPLES_PER_PATH = 24
"""Camera samples of a group for each of its light paths."""
FEWEST, MOST = 5, 7
"""Light paths of a group, as powers of four: full grids of strata, and few sizes."""


def paths_for(samples: int) -> int:
    """Light paths of a group: few, but none used so much that its noise shows."""
    return int(4 ** np.clip(round(log2(max(samples, 1) / SAMPLES_PER_PATH) / 2), FEWEST, MOST))


def joined_integrand(view: ViewSensor, opened: OpenScene, max_depth: int) -> Shared:
    """What `radiance_sampler` samples, by joined paths; see `sampling.estimate.Shared`."""
    sensor = view.sensor()
    longest, roulette = (dr.opaque(mi.UInt32, depth) for depth in (max_depth, view.render.rr_depth))
    lamps, share = lamps_of(opened.scene), dr.opaque(mi.Float, lamp_share(opened.illumination))
    half = tan(radians(view.camera.fov / 2))
    pixel_area = dr.opaque(mi.Float, (2 * half / view.render.width) ** 2)
    forward = mi.Vector3f(sensor.world_transform() @ mi.Vector3f(0, 0, 1))
    dr.make_opaque(forward)

    def shared(groups: Groups) -> tuple[Integrand, None]:
        world = World(opened.scene, longest, roulette, opened.features, opened.fog)
        vertices = trace_light(world, lamps, paths=paths_for(groups.samples), sets=groups.count,
                               seed=derive_seed(groups.seed, "light"))
        light = LightSide(lamps=lamps, table=table_of(vertices), shape=mi.ShapePtr(opened.shape), share=share,
                          splats=dr.opaque(mi.Float, 0.0))

        def integrand(samplers: Samplers, position: mi.Vector2f) -> list[mi.Float]:
            ray = primary_ray(sensor, position)
            pixel_pdf = dr.rcp(pixel_area * dr.dot(ray.d, forward) ** 3)
            found = trace_joined(world, light, samplers.strata, samplers.rest, ray, pixel_pdf, samplers.group,
                                 derive_seed(samplers.seed, "rest") & 0xFFFFFFFF)
            return [*found.image, *found.shading, *found.specular, *(found.shading * found.shading)]

        return integrand, None

    return shared


def lamp_share(illumination: IlluminationPlan) -> float:
    """Share of the light at the object that comes from lamps."""
    total = sum(light.weight for light in illumination.lights)
    lamps = sum(light.weight for light in illumination.lights if not LIGHT_KINDS[light.kind].outside)
    return lamps / total if total else 0.0
