"""The camera of a view, and how its pixels are computed."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from dataset_builder.label.example_plan import RenderPlan
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.rendering.sampling.estimate import Integrand, Shared, estimate, estimate_shared
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.open_scene import sensor_of

CENTRE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewSensor:
    """What all passes of one view share: the camera, and how pixels are computed."""

    camera: CameraPlan
    render: RenderPlan

    def sensor(self) -> mi.Sensor:
        """The camera, as Mitsuba's."""
        return sensor_of(self.camera, self.render.width, self.render.height)

    def estimate(self, integrand: Integrand, pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
        """`sampling.estimate.estimate` with this view's size."""
        return estimate(integrand, pixels, width=self.render.width, height=self.render.height, spp=spp, batches=batches,
                        seed=seed)

    def estimate_shared(self, shared: Shared, pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
        """`sampling.estimate.estimate_shared` with this view's size."""
        return estimate_shared(shared, pixels, width=self.render.width, height=self.render.height, spp=spp,
                               batches=batches, seed=seed)


def primary_ray(sensor: mi.Sensor, position: "mi.Vector2f") -> "mi.Ray3f":
    """The ray through a film position in [0, 1]^2."""
    ray, _ = sensor.sample_ray(0, CENTRE, position, mi.Point2f(CENTRE), True)
    return ray
