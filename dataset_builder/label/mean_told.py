"""What records say of the means of layers, in words."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from dataset_builder.errors import count_of
from dataset_builder.label.example_label import LayerAccuracy


def unknown_means(layers: Iterable[LayerAccuracy]) -> Counter[str]:
    """How often the mean of a layer is not known, by layer."""
    return Counter(layer.name for layer in layers if layer.mean_known == "unknown")


def means_told(unknown: Mapping[str, int]) -> str:
    """A sentence on the layers whose means are not known. unknown: examples by layer."""
    return "means not known: " + ", ".join(f"{name} of {count_of(count, 'example')}" for name, count in unknown.items())


def mean_told(layer: Mapping[str, Any]) -> str:
    """How well the mean of a layer is known. layer: what a record says of it, as JSON; empty where it says nothing."""
    error, known = layer.get("mean_error"), layer.get("mean_known", "known")
    if not error:
        return ""
    said = f"mean ± {error:.2%}"
    top, tail = layer.get("top_share", 0.0), layer.get("tail", 0.0)
    rare = f"rare bright paths: 0.1% of the contributions hold {top:.1%} of it, tail {tail:.2f}"
    told = {"known": said, "widened": f"{said}, widened for {rare}", "unknown": f"mean not known, {rare}"}
    return told.get(known, "")
