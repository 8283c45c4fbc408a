"""Gates that are checked while an example is built: bounds of the spec, and evidence that is not stored.

Each returns the violations it finds, with figures. Arrays are (H, W, C) float32.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from dataset_builder.label.example_label import LayerAccuracy
from dataset_builder.shards.identities import Violation
from dataset_builder.spec.dataset import GatesSpec

COVERAGE, OVERLAP, ENERGY, SPLIT = "coverage", "mask_overlap", "s_prime_energy", "radiance_split"
MEAN, TAIL = "mean_error", "tail"
SPLIT_NEEDS = ("i_t", "d", "s", "spec", "sd_d", "sd_s", "i_t_se", "s_se", "spec_se")
SIGMAS = 5.0
RARE = 2e-3
ROUNDING = 1e-5
"""Relative difference that float32 sums of a thousand terms may show where everything else agrees."""


def check_gates(layers: Mapping[str, np.ndarray], gates: GatesSpec, evidence: Mapping[str, np.ndarray] | None = None,
                spp: tuple[int, int] | None = None) -> list[Violation]:
    """Every gate whose layers are there, in `evidence` (what gates need, shipped or not, on the object) or the example.

    The radiance split needs i_t, d, s, spec, `sd_d`, `sd_s` and the standard errors of i_t, s and spec, and in fog air
    and its error; `spp` says from how many samples d came in the first-hit pass and in the target pass.
    """
    # Evidence goes first: it is on the object throughout, where a shipped layer may be on the frame
    known = {**layers, **(evidence or {})}
    found = coverage(known["mask"], gates.coverage)
    if "mask_rough" in known:
        found += mask_overlap(known["mask"], known["mask_rough"], gates.mask_overlap)
    if "mask_field" in known:
        found += field_overlap(known["mask"], known["mask_field"], gates.mask_overlap)
    if "s_prime" in known:
        found += s_prime_energy(known["s_prime"], known["mask"], gates.s_prime_energy)
    if set(SPLIT_NEEDS) <= set(known):
        sd_d = one_more(known["sd_d"], known["d"], known["mask"], spp[0]) if spp else known["sd_d"]
        d_se = sd_d * (sampling_error(*spp) if spp else 0.0)
        error = combined_error(d=known["d"], s=known["s"], d_se=d_se, i_t_se=known["i_t_se"], s_se=known["s_se"],
                               spec_se=known["spec_se"] + known.get("air_se", 0.0))
        found += radiance_split(i_t=known["i_t"] - known.get("air", 0.0), d=known["d"], s=known["s"],
                                spec=known["spec"], error=error, sd_d=sd_d, sd_s=known["sd_s"])
    return found


def coverage(mask: np.ndarray, bounds: tuple[float, float]) -> list[Violation]:
    """Mean of the mask, the object's share of the frame, within bounds."""
    return _within(COVERAGE, "share of the frame under the mask", float(mask.mean(dtype=np.float64)), bounds)


def mask_overlap(mask: np.ndarray, mask_rough: np.ndarray, least: float) -> list[Violation]:
    """Intersection over union of two soft masks, sum(min) / sum(max), is at least `least`."""
    union = float(np.maximum(mask, mask_rough).sum(dtype=np.float64))
    shared = float(np.minimum(mask, mask_rough).sum(dtype=np.float64))
    overlap = shared / union if union else 0.0
    return _within(OVERLAP, "intersection over union of mask and mask_rough", overlap, (least, 1.0))


def field_overlap(mask: np.ndarray, mask_field: np.ndarray, least: float) -> list[Violation]:
    """The share of the mask that the field covers, sum(min) / sum(mask), is at least `least`. What stands before the
    object hides nothing of a field, so that there may be more of that."""
    whole = float(mask.sum(dtype=np.float64))
    covered = float(np.minimum(mask, mask_field).sum(dtype=np.float64)) / whole if whole else 0.0
    return _within(OVERLAP, "share of mask that mask_field covers", covered, (least, 1.0))


def s_prime_energy(s_prime: np.ndarray, mask: np.ndarray, bounds: tuple[float, float]) -> list[Violation]:
    """Mean of s_prime over the mask, sum(s_prime mask) / (3 sum(mask)), within bounds: neither black nor blown out."""
    weight = float(mask.sum(dtype=np.float64)) * s_prime.shape[2]
    mean = float((s_prime.astype(np.float64) * mask).sum() / weight) if weight else 0.0
    return _within(ENERGY, "mean of s_prime over the mask", mean, bounds)


def means(layers: Sequence[LayerAccuracy], gates: GatesSpec) -> list[Violation]:
    """Means of layers with light are as well known as the spec asks for."""
    found = []
    for layer in layers:
        if gates.mean_error and (layer.mean_known == "unknown" or not layer.mean_error <= gates.mean_error):
            found_out = f"{layer.mean_error:.3g} ({layer.mean_known})"
            if layer.mean_known == "unknown":
                found_out = f"an unknown one (an error of {layer.mean_error:.3g} as far as was met)"
            reason = f"expected the mean of {layer.name} to be known to {gates.mean_error:g}, got {found_out}"
            found.append(Violation(identity=MEAN, reason=reason))
        if gates.tail and not layer.tail <= gates.tail:
            reason = f"expected a Pareto shape <= {gates.tail:g} of {layer.name}'s contributions, got {layer.tail:.3g}"
            found.append(Violation(identity=TAIL, reason=reason))
    return found


def one_more(sd_d: np.ndarray, d: np.ndarray, mask: np.ndarray, first_hit: int) -> np.ndarray:
    """(H, W, C) deviations of d inside pixels, of `first_hit` samples and one more: one that meets what differs most
    among the eight pixels around, or any d in [0, 1] where one of them is off the mask.

    Samples that all miss a sliver of what is next to it say that nothing varies in the pixel; the target pass, of more
    samples, meets it. With n samples of deviation s and one more that is c off their mean, the deviation is
    sqrt(n / (n + 1) (s^2 + c^2 / (n + 1))).
    """
    rows, columns = mask.shape[:2]
    inside = np.pad(mask > 0, ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = np.pad(d, ((1, 1), (1, 1), (0, 0)), mode="edge")
    off = np.zeros_like(d)
    for place in ((row, column) for row in range(3) for column in range(3)):
        cut = slice(place[0], place[0] + rows), slice(place[1], place[1] + columns)
        off = np.maximum(off, np.where(inside[cut], np.abs(around[cut] - d), np.maximum(d, 1 - d)))
    n = first_hit
    return np.sqrt(n / (n + 1) * (sd_d.astype(np.float64) ** 2 + off**2 / (n + 1)))


def sampling_error(first_hit: int, target: int) -> float:
    """Standard error, per unit of deviation inside a pixel, of d in the first-hit pass less d in the target pass.

    The passes draw their own camera rays, so that edges and textures fall differently into each: the variance of a
    difference of independent means is sd(d)^2 (1/n + 1/m). sd(d) is known from the n samples of the first: their mean
    square about their own mean is (n - 1) / n of it (Bessel's correction).
    """
    return math.sqrt((1 / first_hit + 1 / target) * first_hit / max(first_hit - 1, 1))


def combined_error(*, d: np.ndarray, s: np.ndarray, d_se: np.ndarray, i_t_se: np.ndarray, s_se: np.ndarray,
                   spec_se: np.ndarray) -> np.ndarray:
    """Bound on the standard error of i_t - d s - spec per pixel: se(i_t) + d se(s) + s se(d) + se(spec).

    The terms share random numbers, so their errors are correlated by an unknown amount; the sum of standard deviations
    is the largest that the deviation of the sum can be (Minkowski's inequality).
    """
    return i_t_se.astype(np.float64) + d * s_se.astype(np.float64) + s * d_se.astype(np.float64) + spec_se


def radiance_split(*, i_t: np.ndarray, d: np.ndarray, s: np.ndarray, spec: np.ndarray, error: np.ndarray,
                   sd_d: np.ndarray, sd_s: np.ndarray, sigmas: float = SIGMAS, rare: float = RARE) -> list[Violation]:
    """Radiance is diffuse plus specular: |i_t - d s - spec| <= sigmas error + sd_d sd_s, per pixel and channel.

    A pixel is a mean over its footprint, and the mean of a product is the product of the means plus a covariance:
    i_t = E[d s] + spec = d s + cov(d, s) + spec, with |cov(d, s)| <= sd(d) sd(s) (Cauchy-Schwarz). `sd_d` and `sd_s`
    are the deviations of d and of s over the samples of the pixel; `error` is the combined standard error. What float32
    rounding can add where both vanish is allowed for, relative to the largest term. A share `rare` of lit pixels may
    exceed the bound: errors from the spread of a few batches are at times far too small by chance.
    """
    product = d.astype(np.float64) * s
    residual = np.abs(i_t - product - spec)
    rounding = ROUNDING * np.maximum(np.maximum(np.abs(i_t), product), spec)
    excess = residual - (sigmas * error + sd_d.astype(np.float64) * sd_s + rounding)
    broken = ~(excess <= 0).all(axis=2)
    lit = np.count_nonzero((np.abs(i_t) + product + spec).any(axis=2))
    if np.isfinite(excess).all() and np.count_nonzero(broken) <= rare * lit:
        return []
    worst = int(excess.argmax())
    row, column, _ = (int(i) for i in np.unravel_index(worst, excess.shape))
    bound = residual.flat[worst] - excess.flat[worst]
    reason = (f"expected |i_t - d s - spec - air| <= {bound:g} (air: 0 without fog), got {residual.flat[worst]:g} at "
              f"row {row}, column {column}, {np.count_nonzero(broken)} pixels in all")
    return [Violation(identity=SPLIT, reason=reason)]


def _within(gate: str, what: str, value: float, bounds: tuple[float, float]) -> list[Violation]:
    if bounds[0] <= value <= bounds[1]:
        return []
    return [Violation(identity=gate, reason=f"expected {what} in [{bounds[0]:g}, {bounds[1]:g}], got {value:g}")]
