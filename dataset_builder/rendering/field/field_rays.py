"""Pixels of posed images as rays on the device, in the unit frame of a field: its ball is the unit ball."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.buffers import owned


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldCameras:
    """Cameras of several images."""

    numbers: mi.Float
    """16 of each: rows of the turn with the place of the camera, then focal lengths and principal point."""

    @classmethod
    def of(cls, images: PosedImages, chosen: np.ndarray, centre: np.ndarray, radius: float) -> FieldCameras:
        """Cameras of the `chosen` images, for a ball in metres."""
        poses = images.poses[chosen]
        numbers = np.empty((len(poses), 4, 4))
        numbers[:, :3, :3] = poses[:, :3, :3]
        numbers[:, :3, 3] = (poses[:, :3, 3] - centre) / radius
        numbers[:, 3, :2], numbers[:, 3, 2:] = images.focal[chosen], images.centre[chosen]
        return cls(numbers=owned(mi.Float, numbers.astype(np.float32)))

    def rays(self, image: mi.UInt32, x: mi.Float, y: mi.Float) -> tuple[mi.Point3f, mi.Vector3f]:
        """Origins and unit directions through film positions in pixels."""
        first, second, third, lens = (dr.gather(mi.Vector4f, self.numbers, 4 * image + k) for k in range(4))
        local = mi.Vector3f((x - lens.z) / lens.x, (y - lens.w) / lens.y, 1)
        turned = mi.Vector3f(*(dr.dot(mi.Vector3f(row.x, row.y, row.z), local) for row in (first, second, third)))
        return mi.Point3f(first.w, second.w, third.w), dr.normalize(turned)


def ball_span(origin: mi.Point3f, direction: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Where rays enter and leave the unit ball, from 0; the same twice where they miss it."""
    middle = -dr.dot(origin, direction)
    half = dr.sqrt(dr.maximum(1 - dr.squared_norm(origin + middle * direction), 0))
    return dr.maximum(middle - half, 0), dr.maximum(middle + half, 0)
