"""What noise of the truth does to figures: what a perfect prediction would get, and what a prediction would get against
truth without noise.

The truth is light y of mean x and known standard error s, independent over pixels and of what is predicted. Its noise
is taken as log-normal: never below 0 and skewed, as that of light is, and as wide where light is dim as the share s / y
says. A function f of light has, without noise, the value that f has under 0, 1 and 2 times as much noise again, a
parabola through the three, taken at -1 (`without_noise`): SIMEX (Cook and Stefanski, JASA 89, 1994), with means by
Gauss-Hermite quadrature. So PSNR is that of a mean squared error whose noise is taken off, through the display curve,
and SSIM has the noise taken off its local variances. L1 and the Lab angle have a kink where a prediction is right, and
no such estimate: their squares are extrapolated, which is exact where errors are normal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from math import nan, sqrt

import numpy as np
import torch

from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.ranges import mean_inside, tone_map
from dataset_builder.lightnet.measures.colour import lab, lab_angle
from dataset_builder.lightnet.measures.metrics import Metrics, box_about, psnr_of, ssim_map
from dataset_builder.seeding import derive_seed

DRAWS = 4
"""Pictures of noise that the Lab angle is taken over."""
MORE = (1.0, sqrt(2))
"""Widths of once and twice as much noise again."""
EXPLAINED, FEWEST = 3.0, 64
"""Neighbours that differ by more standard errors differ by more than noise; and the fewest pairs that say how the noise
of channels goes together."""
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_Z = 4.5 * (_PLACES + 1) / 2
_SHARES = _WEIGHTS * np.exp(-_Z * _Z / 2)
NORMAL = tuple((sign * float(z), float(share / _SHARES.sum()) / 2)
               for z, share in zip(_Z, _SHARES, strict=True) for sign in (-1, 1))
"""Places and weights over a normal distribution, each half by Gauss-Legendre quadrature: right to 1e-4 for |z| and z^2,
which a kink at 0 does not harm."""
THREE = ((0.0, 2 / 3), (sqrt(3), 1 / 6), (-sqrt(3), 1 / 6))
"""Gauss-Hermite quadrature over a normal distribution: right for polynomials up to the fifth degree."""
TINY = 1e-24
UNKNOWN = Metrics(l1=nan, psnr=nan, ssim=nan, lab=nan)
"""Figures that nothing tells."""

Function = Callable[[torch.Tensor], torch.Tensor]


def width_of(light: torch.Tensor, error: torch.Tensor) -> torch.Tensor:
    """Deviation of the logarithm of light, >= 0, with that standard error.

    Of light that is noisy itself, (s / y)^2 is too large by 3 (s / y)^4 in the mean, and far too large where noise left
    little of it: y^2 + 3 s^2 takes the place of y^2.
    """
    return (1 + error.square() / (light.square() + 3 * error.square()).clamp_min(TINY)).log().sqrt()


def moved(light: torch.Tensor, width: torch.Tensor, z: float | torch.Tensor) -> torch.Tensor:
    """Light under log-normal noise, `z` deviations off; its mean over z is `light`."""
    return light * (z * width - width.square() / 2).exp()


def without_noise(function: Function, light: torch.Tensor, width: torch.Tensor) -> torch.Tensor:
    """What `function` of light would be, elementwise, without noise of that width."""
    once, twice = (sum(weight * function(moved(light, more * width, z)) for z, weight in THREE)
                   for more in MORE)
    return 3 * function(light) - 3 * once + twice


def at_no_noise(figures: list[float]) -> float:
    """A figure >= 0 without noise, of those under 1, 2 and 3 times the noise: the root of its square's parabola."""
    once, twice, thrice = (figure * figure for figure in figures)
    return sqrt(max(3 * once - 3 * twice + thrice, 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class NoisyTruth:
    """One example's truth: (1, 3, H, W) exposed light and its standard error, (1, 1, H, W) inside with a pixel at
    least; `seed` of the draws that the Lab angle is taken over."""

    i_t: torch.Tensor
    error: torch.Tensor
    inside: torch.Tensor
    seed: int = 0

    @cached_property
    def ceiling(self) -> Metrics:
        """Figures of a perfect prediction, the light itself, against this truth. That of the Lab angle has a sampling
        error, `lab_error`."""
        light, width, inside = self._cut
        squared, straight = (without_noise(partial(self._apart, measure), light, width)
                             for measure in (torch.square, torch.abs))
        shown, variance = self._clean
        alike = ssim_map(shown, tone_map(light), variance, shared=True)
        return Metrics(l1=max(float(mean_inside(straight, inside)), 0.0), psnr=psnr_of(mean_inside(squared, inside)),
                       ssim=float(mean_inside(alike, inside)), lab=float(np.mean(self._lab_apart)))

    @property
    def lab_error(self) -> float:
        """Standard error of the ceiling's Lab angle, from its draws."""
        return float(np.std(self._lab_apart, ddof=1)) / sqrt(DRAWS)

    def corrected(self, predicted: torch.Tensor) -> Metrics:
        """Estimated figures of a (1, 3, H, W) prediction, exposed light, against truth without noise.

        A mean squared error that is less than its own standard error counts as that: PSNR is then a bound from below.
        """
        inside = self._cut[2]
        found = tone_map(self._about(predicted)).clamp(0, 1)
        shown, variance = self._clean
        squared = (found - shown).square() - variance
        pixels = squared.mean(dim=1)[inside[:, 0] > 0]
        least = float(pixels.std(correction=0)) / sqrt(len(pixels))
        return Metrics(l1=self._straight(found), psnr=psnr_of(mean_inside(squared, inside).clamp_min(least)),
                       ssim=float(mean_inside(ssim_map(found, shown, variance), inside)), lab=self._angle(found))

    @cached_property
    def _cut(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Light, the width of its noise, both 0 outside, and what is inside, about the object."""
        light = self._about(self.i_t).clamp_min(0)
        return light, width_of(light, self._about(self.error)), self._about(torch.ones_like(self.inside))

    def _about(self, picture: torch.Tensor) -> torch.Tensor:
        """(1, C, H', W') float64, the part about the object, 0 outside of it."""
        box = box_about(self.inside[0])
        return torch.where(self.inside[0][box] > 0, picture[0][box].cpu().double(), 0)[None]

    @cached_property
    def _clean(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Display values without the bias of noise, and the variance that noise has left them with."""
        light, width, _ = self._cut
        shown = without_noise(tone_map, light, width)
        return shown, shown.square() - without_noise(lambda values: tone_map(values).square(), light, width)

    def _apart(self, measure: Function, light: torch.Tensor) -> torch.Tensor:
        """Mean of a measure of how far noise moves display values of `light`."""
        shown, width = tone_map(light), self._cut[1]
        return torch.stack([weight * measure(tone_map(moved(light, width, z)) - shown)
                            for z, weight in NORMAL]).sum(dim=0)

    def _straight(self, found: torch.Tensor) -> float:
        """L1 against truth without noise."""
        light, width, inside = self._cut
        figures = [float(mean_inside((found - tone_map(light)).abs(), inside))]
        for more in MORE:
            figures.append(sum(weight * float(mean_inside((found - tone_map(moved(light, more * width, z))).abs(),
                                                          inside)) for z, weight in NORMAL))
        return at_no_noise(figures)

    @cached_property
    def _noise(self) -> torch.Tensor:
        """(2 `DRAWS`, 3, H, W) normal deviates whose channels go together as those of the truth's noise."""
        light = self._cut[0]
        noise = torch.randn((2 * DRAWS, *light.shape[1:]), dtype=light.dtype,
                            generator=torch.Generator().manual_seed(self.seed))
        return torch.einsum("cd,ndhw->nchw", torch.linalg.cholesky(self.together), noise)

    @cached_property
    def together(self) -> torch.Tensor:
        """(3, 3) correlation of the channels' noise, of neighbours that differ by no more than noise explains."""
        light, _, inside = self._cut
        variance, pairs = self._about(self.error).square(), []
        for dim in (-2, -1):
            apart = light.diff(dim=dim) / variance.unfold(dim, 2, 1).sum(dim=-1).clamp_min(TINY).sqrt()
            pairs.append(apart[0][:, inside.unfold(dim, 2, 1).amin(dim=-1)[0, 0] > 0].T)
        apart = torch.cat(pairs)
        apart = apart[(apart.abs() < EXPLAINED).all(dim=1)]
        moments = apart.T @ apart
        size = moments.diagonal().sqrt()
        if len(apart) < FEWEST or not bool((size > 0).all()):
            return torch.eye(3, dtype=light.dtype)
        # A hair off, so that the noise of equal channels has a root, too
        return 0.999 * moments / size[:, None] / size + 0.001 * torch.eye(3, dtype=light.dtype)

    @cached_property
    def _lab_apart(self) -> list[float]:
        """The ceiling's Lab angle by each of `DRAWS` pictures of noise."""
        light, width, inside = self._cut
        angles = []
        for noise, other in zip(self._noise[:DRAWS], self._noise[DRAWS:], strict=True):
            figures = []
            for more in (0.0, *MORE):
                noisy = moved(light, more * width, other)
                one, two = (lab(tone_map(light)) for light in (noisy, moved(noisy, width, noise)))
                figures.append(float(mean_inside(lab_angle(one, two, inside), inside)))
            angles.append(3 * figures[0] - 3 * figures[1] + figures[2])
        return angles

    @cached_property
    def _lab_noisier(self) -> list[list[torch.Tensor]]:
        """Lab of the truth as it is, and under as much noise again and twice as much."""
        light, width, _ = self._cut
        return [[lab(tone_map(light))], *([lab(tone_map(moved(light, more * width, noise)))
                                           for noise in self._noise[:DRAWS // 2]] for more in MORE)]

    def _angle(self, found: torch.Tensor) -> float:
        """The Lab angle against truth without noise."""
        shown, inside = lab(found), self._cut[2]
        return at_no_noise([sum(float(mean_inside(lab_angle(shown, one, inside), inside)) for one in several)
                            / len(several) for several in self._lab_noisier])


def noise_of(batch: Batch) -> NoisyTruth | None:
    """The truth of a batch of one with its noise; None where that is not known."""
    truth = batch.truth
    return None if truth.i_t_se is None else NoisyTruth(
        i_t=truth.i_t, error=truth.i_t_se, inside=batch.inputs.inside, seed=derive_seed(0, "noise", batch.keys[0]) >> 1)
