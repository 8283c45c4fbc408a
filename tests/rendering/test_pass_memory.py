"""Passes as bytes: what comes back, and that nothing is kept that another figure says."""

import io
from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.rendering.pass_memory import PassFound, from_bytes, to_bytes
from dataset_builder.rendering.sampling.adaptive import Sampled
from dataset_builder.rendering.sampling.moments import FIGURES, Estimate, of_batches
from dataset_builder.seeding import rng


@pytest.fixture
def estimate() -> Estimate:
    """Of 50 pixels in three channels, from four batches of four samples."""
    return of_batches(rng(3, "batches").gamma(1.0, size=(50, 4, 3)), 16)


def found(estimate: Estimate) -> PassFound:
    return PassFound(pixels=np.arange(50), sampled=Sampled(halves=(estimate,), stopped={"i_t": "error"}),
                     facts={"unit": 0.5})


def test_passes_come_back_to_the_bit(estimate: Estimate) -> None:
    for kept in (estimate, estimate.rounded(), estimate.without_parts(), replace(estimate, odd=estimate.half)):
        back = from_bytes(to_bytes(found(kept)))
        assert back is not None and back.facts == {"unit": 0.5} and back.sampled.stopped == {"i_t": "error"}
        for name in (*FIGURES, "spp"):
            assert np.array_equal(getattr(back.sampled.halves[0], name), getattr(kept, name)), name


def test_layers_without_light_keep_mean_and_error_alone(estimate: Estimate) -> None:
    data = to_bytes(found(estimate.without_parts()))
    with np.load(io.BytesIO(data)) as arrays:
        assert {name for name in arrays.files if arrays[name].shape == (50, 3)} == {"mean0", "error0"}
    assert len(data) < 0.6 * len(to_bytes(found(estimate)))


def test_what_is_no_pass_is_not_known() -> None:
    assert from_bytes(b"PK") is None and from_bytes(b"") is None
