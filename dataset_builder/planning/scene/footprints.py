"""Footprints: oriented rectangles with a height interval, which is all that layout knows of what stands in a scene."""

from dataclasses import dataclass, replace
from math import cos, radians, sin

import numpy as np

Pose = tuple[tuple[float, float, float], float]
"""Position of the base point in metres, and yaw in degrees about Z."""
WALL_GAP = 0.05
"""Metres between furniture and walls: more than a skirting board is thick."""


@dataclass(frozen=True, kw_only=True)
class Box:
    """Axis-aligned box of an asset in its own frame, in metres."""

    low: tuple[float, float, float]
    """Low corner (x, y, z)."""
    high: tuple[float, float, float]
    """High corner (x, y, z)."""

    @property
    def size(self) -> tuple[float, float, float]:
        """Width (x), depth (y) and height (z)."""
        width, depth, height = (b - a for a, b in zip(self.low, self.high, strict=True))
        return width, depth, height


@dataclass(frozen=True, kw_only=True)
class Footprint:
    """A box turned about Z, in metres."""

    centre: tuple[float, float]
    """Its x and y."""
    half: tuple[float, float]
    """Half sizes along its own axes."""
    yaw: float
    """Degrees about Z."""
    bottom: float = 0.0
    top: float = 1.0

    @property
    def axes(self) -> np.ndarray:
        """(2, 2) rows are the rectangle's own x and y axes in the room."""
        c, s = cos(radians(self.yaw)), sin(radians(self.yaw))
        return np.array([[c, s], [-s, c]])

    def reach(self, direction: np.ndarray) -> float:
        """Half the rectangle's width along a unit `direction` (2,): its support function about the centre."""
        return float(np.abs(self.axes @ direction) @ np.asarray(self.half))

    def grown(self, gap: float) -> "Footprint":
        """The same box, `gap` metres further on all four sides."""
        return replace(self, half=(self.half[0] + gap, self.half[1] + gap)) if gap else self

    def corners(self) -> np.ndarray:
        """(4, 2) corners, counter-clockwise."""
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return np.asarray(self.centre) + (signs * np.asarray(self.half)) @ self.axes


def footprint(extent: Box, position: tuple[float, float, float], yaw: float) -> Footprint:
    """The footprint of an asset that stands with its base point at `position`, turned by `yaw` degrees."""
    half = (extent.size[0] / 2, extent.size[1] / 2)
    middle = np.array([extent.low[0] + half[0], extent.low[1] + half[1]])
    turned = Footprint(centre=(0.0, 0.0), half=half, yaw=yaw)
    x, y = np.asarray(position[:2]) + middle @ turned.axes
    return Footprint(centre=(float(x), float(y)), half=half, yaw=yaw, bottom=position[2] + extent.low[2],
                     top=position[2] + extent.high[2])


def overlap(a: Footprint, b: Footprint, gap: float = 0.0) -> bool:
    """Whether two boxes come nearer than `gap` along every separating axis (Gottschalk et al. 1996) and in height."""
    if a.bottom >= b.top or b.bottom >= a.top:
        return False
    between = np.asarray(b.centre) - np.asarray(a.centre)
    return all(abs(between @ axis) < a.reach(axis) + b.reach(axis) + gap for axis in (*a.axes, *b.axes))


def standing(extent: Box, centre: np.ndarray, yaw: float, floor: float = 0.0) -> Pose:
    """The pose that brings the middle of an asset's footprint to `centre` (2,), on a floor at height `floor`."""
    offset = np.asarray(footprint(extent, (0.0, 0.0, 0.0), yaw).centre)
    return (float(centre[0] - offset[0]), float(centre[1] - offset[1]), floor), yaw
