"""Where a target turns on the spot: the upright cylinder that it sweeps, which must be free."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import PlacedObject
from dataset_builder.planning.scene.footprints import Box, footprint, standing
from dataset_builder.planning.scene.shell import Geometry

WAYS, HEIGHTS = 96, 9
"""Rays that a cylinder is looked along in: around, and above each other."""
RISE = 0.02
"""Share of its height that the lowest and highest rays keep from its ends: what it stands on is not in its way."""


def swept_box(extent: Box) -> Box:
    """The upright box with a square footprint that holds an asset at every angle about the middle of its own."""
    (width, depth, _), (x, y, z) = extent.size, extent.low
    radius, x, y = hypot(width, depth) / 2, x + width / 2, y + depth / 2
    return Box(low=(x - radius, y - radius, z), high=(x + radius, y + radius, extent.high[2]))


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """The cylinder that an asset sweeps, turning about the vertical through the middle of its footprint."""

    extent: Box
    """Of the asset in its own frame."""
    axis: tuple[float, float]
    """Where the vertical stands, x and y, metres."""
    bottom: float
    top: float

    @classmethod
    def of(cls, placed: PlacedObject, extent: Box) -> "Sweep":
        """Of a placed asset."""
        box = footprint(extent, placed.position, placed.yaw)
        return cls(extent=extent, axis=box.centre, bottom=box.bottom, top=box.top)

    @property
    def radius(self) -> float:
        """Metres."""
        return hypot(*self.extent.size[:2]) / 2

    def turned(self, placed: PlacedObject, angle: float) -> PlacedObject:
        """The asset turned by degrees about the axis."""
        yaw = (placed.yaw + angle + 180) % 360 - 180
        position, yaw = standing(self.extent, np.array(self.axis), yaw, placed.position[2])
        return placed.model_copy(update={"position": position, "yaw": yaw})

    def holds(self, point: np.ndarray, margin: float) -> bool:
        """Whether a point (3,) is in the cylinder, or nearer to it than `margin` metres."""
        aside = max(float(np.hypot(*(point[:2] - self.axis))) - self.radius, 0.0)
        above = max(self.bottom - float(point[2]), float(point[2]) - self.top, 0.0)
        return hypot(aside, above) <= margin if margin > 0 else aside == above == 0

    def check(self, others: Sequence[Geometry], name: str) -> None:
        """Raises PlanError where others come into the cylinder. name: of the target."""
        angles = np.linspace(0, 2 * np.pi, WAYS, endpoint=False)
        rise = RISE * (self.top - self.bottom)
        heights = np.linspace(self.bottom + rise, self.top - rise, HEIGHTS)
        around, height = (each.ravel() for each in np.meshgrid(angles, heights))
        ways = np.column_stack([np.cos(around), np.sin(around), np.zeros(len(around))])
        starts = np.column_stack([np.broadcast_to(self.axis, (len(height), 2)), height])
        reach = RayScene(others).first_hit(starts, ways)[1]
        if (nearest := float(reach.min())) < self.radius:
            rule = (f"expected a free circle of {self.radius:.2f} m about the target, which turns on the spot, got "
                    f"something {nearest:.2f} m from its middle, {height[reach.argmin()] - self.bottom:.2f} m above "
                    "what it stands on")
            raise PlanError([Problem(where="", path=name, rule=rule,
                                     hint="`leave_out` what stands there, choose another target, or an `orbit`")])
