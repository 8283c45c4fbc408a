"""How good an image is against a converged one, and how long it takes to get as good as asked."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """Mean of two independent converged images, on the pixels that count. mean, half_difference: (P, C)."""

    inside: np.ndarray
    mean: np.ndarray
    half_difference: np.ndarray

    @classmethod
    def of(cls, first: np.ndarray, second: np.ndarray, inside: np.ndarray) -> "Reference":
        """first, second: (H, W, C); inside: (H, W) of truth."""
        a, b = first[inside].astype(np.float64), second[inside].astype(np.float64)
        return cls(inside=inside, mean=(a + b) / 2, half_difference=(a - b) / 2)

    def error(self, image: np.ndarray) -> float:
        """relMSE: mean of (x - ref)^2 / (ref^2 + 0.01 m^2), m the mean of ref.

        Less what the reference's own noise adds, which half the difference of its halves estimates without bias.
        """
        raw = np.mean((image[self.inside] - self.mean) ** 2 * self._weight())
        return float(max(raw - self.own_error(), 1e-9))

    def own_error(self) -> float:
        """relMSE that the reference itself may be expected to have."""
        return float(np.mean(self.half_difference**2 * self._weight()))

    def _weight(self) -> np.ndarray:
        return 1 / (self.mean**2 + 0.01 * self.mean.mean() ** 2)


def common_error(first: Sequence[float], second: Sequence[float]) -> float:
    """Middle, on a log scale, of the range of errors that both reached."""
    return float(np.sqrt(max(min(first), min(second)) * min(max(first), max(second))))


def time_to(error: float, seconds: Sequence[float], errors: Sequence[float], floor: bool) -> float:
    """Seconds to an error, log-log between settings; beyond the best of them error falls as 1 / time.

    What is worse than the cheapest setting takes as long as that. floor: beyond the best setting error does not fall
    any more (a denoiser's bias), so the time is infinite.
    """
    order = np.argsort(seconds)
    t, e = np.log(np.asarray(seconds)[order]), np.log(np.minimum.accumulate(np.asarray(errors)[order]))
    wanted = np.log(error)
    if wanted < e[-1]:
        return float("inf") if floor else float(np.exp(t[-1] + e[-1] - wanted))
    return float(np.exp(np.interp(-wanted, -e, t)))
