"""The floor space of furniture: oriented rectangles with a height interval, and whether two of them overlap."""

from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Box:
    """Axis-aligned box of an asset in its own frame, in metres: low and high corners (x, y, z)."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def size(self) -> tuple[float, float, float]:
        """Width (x), depth (y) and height (z)."""
        width, depth, height = (b - a for a, b in zip(self.low, self.high, strict=True))
        return width, depth, height


@dataclass(frozen=True, kw_only=True)
class Footprint:
    """A box turned by `yaw` degrees about Z: centre (x, y), half sizes along its own axes, heights [bottom, top]."""

    centre: tuple[float, float]
    half: tuple[float, float]
    yaw: float
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


def inside_room(box: Footprint, width: float, depth: float, height: float, gap: float = 0.0) -> bool:
    """Whether a box keeps `gap` metres from the four walls of a room about the origin, and is under its ceiling."""
    reach = np.array([box.reach(np.array([1.0, 0.0])), box.reach(np.array([0.0, 1.0]))])
    room = np.array([width, depth]) / 2 - gap
    return bool((np.abs(box.centre) + reach <= room).all()) and box.top <= height
