"""Estimates in words, with as many digits as a metric calls for, and Markdown tables of them."""

from collections.abc import Sequence
from math import isfinite

from dataset_builder.lightnet.measures.metrics import Metric
from dataset_builder.lightnet.results.clustered_means import ClusteredMean

DIGITS = {"psnr": 2}
"""After the point by metric, `OTHERWISE` where not stated."""
OTHERWISE = 4


def rounded(value: float, metric: str, sign: str = "") -> str:
    """A value of a metric. sign: "+" to show it where it is above 0, too."""
    return f"{value:{sign}.{DIGITS.get(metric, OTHERWISE)}f}"


def plus_minus(found: ClusteredMean, metric: str, sign: str = "") -> str:
    """A mean and its standard error, which one object does not have."""
    error = f" ± {rounded(found.error, metric)}" if isfinite(found.error) else ""
    return rounded(found.mean, metric, sign) + error


def heading(metric: Metric) -> str:
    """Symbol and unit of a metric, and which way is better."""
    return f"{metric.symbol}{f', {metric.unit}' if metric.unit else ''} ({metric.better} is better)"


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """The lines of a table."""
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
                     for cells in (head, ["---"] * len(head), *rows))
