"""Do other paths find the same means as camera paths? The frame, the object, sixths of the pixels, and every pixel."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.transports.runs import TRUTH_SPP, Runs

MOST, Z = 0.1, 3.5
"""Difference of means in per cent, and in standard errors, that is still none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bias:
    """New paths against old ones in one pass."""

    case: str
    lamps: str
    runs: tuple[int, int]
    difference: np.ndarray
    """(R,) of the means of the regions, per cent."""
    error: np.ndarray
    """(R,) standard errors of the differences."""
    pixels: np.ndarray
    """(P,) differences of those that light reaches, in standard errors."""
    noise: tuple[float, float]
    """Deviation of a run's mean over the frame at the spp of the new paths, per cent."""

    @property
    def z(self) -> np.ndarray:
        """(R,) differences in standard errors."""
        return self.difference / self.error

    @property
    def wrong(self) -> bool:
        """Whether the mean of frame or object is off."""
        return bool(np.any(np.abs(self.z[:2]) >= Z) or np.any(np.abs(self.difference[:2]) - 2 * self.error[:2] > MOST))


def bias(case: str, lamps: str, old: Runs, new: Runs, spp: int) -> Bias:
    """old: of TRUTH_SPP each; new: of `spp`."""
    (a, a_error), (b, b_error) = old.regions(), new.regions()
    (x, x_variance), (y, y_variance) = old.grey(), new.grey()
    lit = (x_variance > 0) & (y_variance > 0)
    noise = (100 * a_error[0] / a[0] * np.sqrt(old.number * TRUTH_SPP / spp),
             100 * b_error[0] / b[0] * np.sqrt(new.number))
    return Bias(case=case, lamps=lamps, runs=(old.number, new.number), difference=100 * (b - a) / a,
                error=100 * np.hypot(a_error, b_error) / a, noise=noise,
                pixels=(y - x)[lit] / np.sqrt(x_variance + y_variance)[lit])


def print_bias(found: Bias) -> None:
    """One line."""
    z, freedom = found.z, sum(found.runs) - 2
    frame, whole = (f"{found.difference[k]:+.3f}% +- {found.error[k]:.3f} Z {z[k]:+.2f}" for k in (0, 1))
    print(f"{found.case:26} {found.lamps:20} runs {found.runs[0]}, {found.runs[1]} | frame {frame} | object {whole} | "
          f"sixths Z {' '.join(f'{value:+.2f}' for value in z[2:])} | pixels Z mean {found.pixels.mean():+.3f} "
          f"rms {np.sqrt(np.mean(found.pixels**2)):.3f} (t: {np.sqrt(freedom / max(freedom - 2, 1)):.3f}), beyond {Z}: "
          f"{np.mean(np.abs(found.pixels) > Z):.4f} | sd of a run's frame {found.noise[0]:.3f}%, {found.noise[1]:.3f}%"
          f"{' | OFF' if found.wrong else ''}", flush=True)


def print_lean(found: Sequence[Bias]) -> None:
    """Whether all cases together lean to one side: their mean difference, weighted by how well each is known."""
    for k, name in enumerate(("frame", "object")):
        weight = np.array([1 / entry.error[k] ** 2 for entry in found])
        mean = float(np.sum([w * entry.difference[k] for w, entry in zip(weight, found, strict=True)]) / weight.sum())
        z = np.array([entry.z[k] for entry in found])
        print(f"{name}: {len(found)} cases, mean difference {mean:+.4f}% +- {1 / np.sqrt(weight.sum()):.4f}, "
              f"Z rms {np.sqrt(np.mean(z**2)):.2f}, sum of Z over root n {z.sum() / np.sqrt(len(z)):+.2f}, "
              f"largest |Z| {np.abs(z).max():.2f}")
