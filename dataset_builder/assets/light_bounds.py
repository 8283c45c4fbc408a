"""What numbers a light may have, whichever file it is from."""

from math import isfinite
from pathlib import Path

from dataset_builder.assets.file_model import refuse

MOST_RADIANCE = 1e12
"""W/(m^2 sr), W/m^2 or W/sr of a channel: the sun's own is 2e7."""
MOST_METRES = 1e6
"""Of a light's size, and of its distance from the origin."""

LEAST_BEAM = 1e-3
"""Degrees of the beam of a spot that falls off from its axis on, for 0 stands for a beam that is not stated."""


def bounded(path: Path, at: str, name: str, value: float, *, low: float = 0.0, high: float = MOST_RADIANCE) -> float:
    """The value of `name`. Raises UserError that names file and light where it is no number in [low, high]."""
    if not (isfinite(value) and low <= value <= high):
        refuse(path, f"expected {name} in [{low:g}, {high:g}], got {value:g}", "correct it, or take the light away",
               at=at)
    return value
