"""Which way a rectangle of light lies."""

from collections.abc import Sequence
from math import cos, radians, sin

import numpy as np

STEEP = 0.9
"""Cosine between a direction and the vertical above which +X takes the place of +Z as what is up."""


def upward(direction: Sequence[float]) -> list[float]:
    """What a light's sides are square to: +Z, or +X for one that shines nearly straight up or down."""
    return [1.0, 0.0, 0.0] if abs(direction[2]) > STEEP * np.linalg.norm(direction) else [0.0, 0.0, 1.0]


def rectangle_axes(direction: Sequence[float], turn: float) -> tuple[np.ndarray, np.ndarray]:
    """(3,) and (3,): unit vectors along the first and the second side of a rectangle that shines along `direction`.

    Unturned, the first is square to `upward`; `turn` degrees carry it towards the second. First, second and direction
    are right-handed.
    """
    forward = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    first = np.cross(upward(direction), forward)
    first /= np.linalg.norm(first)
    second = np.cross(forward, first)
    c, s = cos(radians(turn)), sin(radians(turn))
    return c * first + s * second, c * second - s * first
