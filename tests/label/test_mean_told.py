"""What is said of means that rare bright paths decide, and the gates that bound them."""

from typing import Any

import pytest

from dataset_builder.label.example_label import LayerAccuracy
from dataset_builder.label.mean_told import mean_told, means_told, unknown_means
from dataset_builder.shards.gates import MEAN, TAIL, means
from dataset_builder.spec.dataset import GatesSpec


def layer(name: str = "i_t", **values: Any) -> LayerAccuracy:
    """A layer whose mean is well known, but for `values`."""
    figures = dict.fromkeys((f"{prefix}relative_error{suffix}" for prefix in ("", "object_") for suffix in ("", "_95")),
                            0.05)
    return LayerAccuracy(name=name, stopped="spp", **{**figures, "mean_error": 0.01, "tail": 0.2, "top_share": 0.004,
                                                      **values})


KNOWN, WIDE = layer("s"), layer("spec", mean_known="widened", mean_error=0.03, tail=0.55)
UNKNOWN = layer(mean_known="unknown", mean_error=0.4, tail=0.93, top_share=0.36)


def test_layers_are_counted_and_named() -> None:
    counted = unknown_means([KNOWN, UNKNOWN, WIDE, UNKNOWN, layer("s", mean_known="unknown")])
    assert counted == {"i_t": 2, "s": 1}
    assert means_told(counted) == "means not known: i_t of 2 examples, s of 1 example"


@pytest.mark.parametrize(("of", "said"), [
    (KNOWN, "mean ± 1.00%"),
    (WIDE, "mean ± 3.00%, widened for rare bright paths: 0.1% of the contributions hold 0.4% of it, tail 0.55"),
    (UNKNOWN, "mean not known, rare bright paths: 0.1% of the contributions hold 36.0% of it, tail 0.93")])
def test_a_layer_in_words(of: LayerAccuracy, said: str) -> None:
    assert mean_told(of.model_dump()) == said


@pytest.mark.parametrize("of", [{"name": "i_t"}, {"name": "i_t", "mean_error": 0.0},
                                {"name": "i_t", "mean_error": 0.1, "mean_known": "perhaps"}])
def test_a_label_that_does_not_know_says_nothing(of: dict[str, Any]) -> None:
    assert mean_told(of) == ""


def test_gates_are_off_by_default() -> None:
    assert not means([UNKNOWN], GatesSpec())


def test_a_mean_must_be_known_as_well_as_asked() -> None:
    assert not means([KNOWN, WIDE], GatesSpec(mean_error=0.03))
    (found,) = means([KNOWN, WIDE], GatesSpec(mean_error=0.02))
    assert found.identity == MEAN
    assert found.reason == "expected the mean of spec to be known to 0.02, got 0.03 (widened)"
    # However wide the bound, what is not known does not pass
    (found,) = means([UNKNOWN], GatesSpec(mean_error=1.0))
    assert found.identity == MEAN and "to be known to 1, got an unknown one (an error of " in found.reason


def test_a_tail_is_bounded() -> None:
    (found,) = means([KNOWN, WIDE, UNKNOWN], GatesSpec(tail=0.6))
    assert found.identity == TAIL and "<= 0.6 of i_t's contributions, got 0.93" in found.reason
