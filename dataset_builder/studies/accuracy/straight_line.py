"""Straight lines through positive measurements whose errors grow with them, with intervals."""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.special import stdtrit

ROUNDS = 12
"""Of reweighting."""
LEAST_SPREAD = 1e-3
"""Relative scatter that is assumed at least: fewer points than this tells apart are a coincidence."""
TINY = 1e-300


@dataclass(frozen=True, kw_only=True)
class Line:
    """y = slope x + rest, neither below 0."""

    slope: float
    slope_se: float
    """Standard error."""
    rest: float
    rest_se: float
    spread: float
    """Relative scatter of the measurements about the line, standard deviation of one."""
    freedom: int

    @property
    def factor(self) -> float:
        """Standard errors to either side that a 95% interval has."""
        return float(stdtrit(max(self.freedom, 1), 0.975))

    @property
    def slope_within(self) -> float:
        """Half the width of the 95% interval of the slope."""
        return self.factor * self.slope_se

    @property
    def rest_within(self) -> float:
        """Half the width of the 95% interval of the rest; where the rest is 0, it is below this."""
        return self.factor * self.rest_se

    def at(self, x: float) -> float:
        """The line at x."""
        return self.slope * x + self.rest


def straight_line(x: np.ndarray, y: np.ndarray, error: np.ndarray | float = 0.0, shared: float = 0.0, *,
                  through_zero: bool = False) -> Line:
    """The line through (N,) points, N >= 2, by least squares whose weights follow the line: every point scatters by a
    share of its height, the same for all, and by `error` (N,) of its own besides; `shared` is the standard error of
    what all points have in common, which goes into that of the rest. through_zero: a line without a rest.

    y may be below 0 where an error takes it there. Raises ValueError with fewer than two points.
    """
    if len(x) < 2:
        raise ValueError(f"expected at least two points, got {len(x)}")
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    own = np.square(np.broadcast_to(np.asarray(error, dtype=np.float64), x.shape))
    height, spread, freedom = np.maximum(np.abs(y), TINY), 0.1, max(len(x) - 2, 1)
    for _ in range(ROUNDS):
        weight = 1 / (np.square(spread * height) + own + TINY)
        slope, rest, *variances = _solved(x, y, weight)
        if through_zero:
            rest, variances = -1.0, [1 / max(float(weight @ np.square(x)), TINY), 0.0]
        found = _not_negative(x, y, weight, slope, rest)
        height = np.maximum(found[0] * x + found[1], TINY)
        excess = np.maximum(np.square(y - height) - own, 0) / np.square(height)
        spread = max(float(np.sqrt(np.sum(excess) / freedom)), LEAST_SPREAD)
    return Line(slope=found[0], rest=found[1], slope_se=sqrt(variances[0]), rest_se=sqrt(variances[1] + shared**2),
                spread=spread, freedom=freedom)


def _solved(x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> tuple[float, float, float, float]:
    """Slope, rest and their variances, by the normal equations about the weighted mean of x."""
    total = float(weight.sum())
    middle, height = float(weight @ x) / total, float(weight @ y) / total
    apart = max(float(weight @ np.square(x - middle)), TINY)
    slope = float(weight @ ((x - middle) * (y - height))) / apart
    return slope, height - slope * middle, 1 / apart, 1 / total + middle**2 / apart


def _not_negative(x: np.ndarray, y: np.ndarray, weight: np.ndarray, slope: float, rest: float) -> tuple[float, float]:
    """Both as they are, or the other alone where one is below 0."""
    if rest < 0:
        return max(float(np.sum(weight * x * y) / np.sum(weight * x * x)), 0.0), 0.0
    if slope < 0:
        return 0.0, max(float(np.sum(weight * y) / np.sum(weight)), 0.0)
    return slope, rest
