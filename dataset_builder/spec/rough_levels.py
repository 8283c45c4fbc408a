"""What named levels and `like` of a spec stand for, and how fine a mesh their steps need."""

from collections.abc import Callable
from functools import partial
from math import hypot

from dataset_builder.spec.numbers import support
from dataset_builder.spec.rough import FieldStep, Level, LikeStep, Step


def _field(sigma: float) -> tuple[Step, ...]:
    return (FieldStep(kind="field", sigma=sigma, length=0.06, octaves=2),)


def _fields(*each: tuple[float, float]) -> tuple[Step, ...]:
    return tuple(FieldStep(kind="field", sigma=sigma, length=length, along="normal") for sigma, length in each)


NAMED: dict[str, tuple[Step, ...]] = {
    "smooth": _field(0.0), "light": _field(0.003), "medium": _field(0.006), "heavy": _field(0.012),
    "extreme": _field(0.024),
}
"""Steps of named levels: each is twice as rough as the one before, the first without noise."""
RECONSTRUCTED: dict[str, tuple[Step, ...]] = {
    "field": _fields((0.022, 0.25), (0.0071, 0.03)), "smooth_field": _fields((0.036, 0.3), (0.005, 0.05)),
}
"""What `like` stands for. Measured on a few reconstructions each: distance from the clean surface (root mean square
0.023 and 0.036 radii at the median object) and median tilt of normals (16.5 and 10.4 degrees). A field along normals
tilts them by arctan(1.18 g) at the median, g being the root sum of squares of sigma / length. The lengths are chosen:
as wide as filled cavities, and two or three cells of the reconstructions' grids."""


def sigma_of(name: str) -> float:
    """Standard deviation of the noise of a named level, in bounding radii."""
    return hypot(*(support(step.sigma)[0] for step in NAMED[name] if isinstance(step, FieldStep)))


def steps_at(level: Level) -> tuple[Step, ...]:
    """The steps of a level, with what `like` stands for in its place; none for a sigma, which is vertex noise."""
    steps = NAMED[level] if isinstance(level, str) else level if isinstance(level, tuple) else ()
    return tuple(part for step in steps
                 for part in (RECONSTRUCTED[step.of] if isinstance(step, LikeStep) else (step,)))


def shortest(steps: tuple[Step, ...]) -> float | None:
    """The shortest length that a mesh must resolve for steps, in bounding radii; None where none has one."""
    lengths = (step_length(step.kind, partial(_least, step)) for step in steps)
    return min((length for length in lengths if length is not None), default=None)


def step_length(kind: str, value: Callable[[str], float]) -> float | None:
    """The shortest length of a step by the values of its fields, None where it has none."""
    if kind == "field":
        return value("length") / 2 ** (value("octaves") - 1)
    return value("length") if kind == "scanlines" else value("width") if kind == "bumps" else None


def _least(step: Step, name: str) -> float:
    return support(getattr(step, name))[0]
