"""What pages say of the truth's noise: the figures of a perfect prediction, and those of methods without noise."""

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING

from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.report.page_parts import plus_minus, rounded

if TYPE_CHECKING:
    from dataset_builder.lightnet.results.clustered_means import ClusteredMean

CEILING = "noise ceiling"
NOISE = """The truth is rendered, and noisy. *Noise ceiling* is what a perfect prediction would get against it. *Without
noise* is an estimate of what a method would get against truth without noise, from the standard error of every pixel;
PSNR is bounded from below where the error is less than the estimate can tell. Lab angles of the ceiling are taken over
four draws of noise, L1 and Lab angles without noise are extrapolated."""


def unknown(reason: str) -> str:
    """A sentence on why there are no such figures."""
    return f"Noise ceiling unknown: {reason}."


def ceiling_line(ceiling: Mapping[str, "ClusteredMean"], unknown_noise: str = "") -> str:
    """What a perfect prediction would get, by names of metrics; `unknown_noise` says why where nobody knows."""
    if not isfinite(ceiling["psnr"].mean):
        return unknown(unknown_noise or "nobody says it")
    return f"{CEILING}: " + ", ".join(f"{metric.symbol} {plus_minus(ceiling[metric.name], metric.name)}"
                                      for metric in METRICS)


def beside(found: "ClusteredMean", corrected: "ClusteredMean", metric: str) -> str:
    """A figure for the terminal, on the line below what it would be without noise, where that is known."""
    if not isfinite(corrected.mean):
        return plus_minus(found, metric)
    return f"{plus_minus(found, metric)}\n({rounded(corrected.mean, metric)} without noise)"


def with_interval(found: "ClusteredMean", metric: str) -> str:
    """A mean, its standard error and its interval."""
    if not isfinite(found.half_width):
        return plus_minus(found, metric)
    low, high = (rounded(found.mean + sign * found.half_width, metric) for sign in (-1, 1))
    return f"{plus_minus(found, metric)} ({low} to {high})"
