"""The frame that a view is rendered in: the target object at the origin, about one unit large.

Single precision resolves a ten-millionth of a coordinate, and Mitsuba starts rays a ten-thousandth of one above a
surface. Around an object of a millimetre, or a kilometre from the origin, both are as large as the object; so plans,
in metres and double precision, are moved and scaled before anything is uploaded. The unit is a power of two, which
leaves mantissas as they are.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from dataset_builder.label.scene_plan import CameraPlan, FogPlan, IlluminationPlan, LightPlan, PortalPlan, Vector
from dataset_builder.light_kinds import LENGTHS, LIGHT_KINDS
from dataset_builder.rendering.scene.triangle_soup import Soup


@dataclass(frozen=True, kw_only=True)
class LocalFrame:
    """Where the origin of the frame lies, and how long its unit is."""

    origin: Vector = (0.0, 0.0, 0.0)
    """In the world, metres."""
    unit: float = 1.0
    """Metres per unit of the frame."""

    @classmethod
    def of(cls, corners: np.ndarray) -> "LocalFrame":
        """The frame of an object's (..., 3) points: its middle, and the power of two next to its radius.

        >>> LocalFrame.of(np.array([[0, 0, 0], [0, 0, 6]]))
        LocalFrame(origin=(0.0, 0.0, 3.0), unit=4.0)
        """
        points = corners.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        radius = float(np.linalg.norm(high - low) / 2)
        unit = 2.0 ** round(math.log2(radius)) if radius > 0 else 1.0
        return cls(origin=_vector((low + high) / 2), unit=unit)

    def points(self, world: np.ndarray) -> np.ndarray:
        """(..., 3) points of the world, in this frame."""
        return (world - np.array(self.origin)) / self.unit

    def soup(self, soup: Soup) -> Soup:
        """Triangles of the world, in this frame."""
        return replace(soup, corners=self.points(soup.corners))

    def camera(self, camera: CameraPlan) -> CameraPlan:
        """The camera, in this frame."""
        return camera.model_copy(update={"position": self._point(camera.position),
                                         "target": self._point(camera.target)})

    def illumination(self, illumination: IlluminationPlan) -> IlluminationPlan:
        """The lights, in this frame: they send the same radiance to the same surfaces."""
        return illumination.model_copy(update={"lights": tuple(map(self._light, illumination.lights))})

    def portal(self, portal: PortalPlan) -> PortalPlan:
        """The opening, in this frame."""
        right, up = (_vector(np.array(side) / self.unit) for side in (portal.right, portal.up))
        return PortalPlan(corner=self._point(portal.corner), right=right, up=up)

    def fog(self, fog: FogPlan) -> FogPlan:
        """The medium, in this frame: extinction is per unit."""
        return fog.model_copy(update={"extinction": fog.extinction * self.unit})

    def _light(self, light: LightPlan) -> LightPlan:
        factor = self.unit ** LENGTHS[LIGHT_KINDS[light.kind].quantity]
        return light.model_copy(update={
            "position": self._point(light.position), "size": light.size / self.unit,
            "length": light.length / self.unit,
            "radiance": tuple(value / factor for value in light.radiance)})

    def _point(self, point: Vector) -> Vector:
        return _vector(self.points(np.array(point)))


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
