"""What may be said of a denoised layer's bias: a figure, a bound where noise hides it, or nothing."""

import numpy as np
import pytest

from dataset_builder.engine.calibration import Figures, _combined, compare
from dataset_builder.label.denoised_words import told_bias, told_relmse


def layers(value: np.ndarray, raw: np.ndarray, error: float, mask: np.ndarray) -> dict[str, np.ndarray]:
    return {"s": value, "s_raw": raw, "s_se": np.full_like(value, error), "mask": mask}


def made(rng: np.random.Generator, *, bias: float = 0.0, noise: float = 0.3, reference: float = 0.05,
         level: float = 1.0, side: int = 64) -> Figures:
    """Figures of a made-up layer of one level whose denoised twin is wrong by `bias` in one pixel of two."""
    shape, mask = (side, side, 3), np.ones((side, side, 1))
    wrong = bias * (np.arange(side) % 2)[:, None, None]
    truth = layers(level + rng.normal(0, reference, shape) * level, np.zeros(shape), reference * level, mask)
    asked = [layers(level * (1 + wrong + rng.normal(0, noise, shape)), level + np.zeros(shape), noise * level, mask)
             for _ in range(2)]
    return compare("s", asked, truth)


def test_a_bias_that_noise_hides_has_a_bound() -> None:
    """In 95 of 100 runs the bound holds, and a bias of nothing is never told as 0."""
    rng = np.random.default_rng(8)
    found = [_combined("s", [made(rng, bias=0.05, noise=0.6) for _ in range(2)]) for _ in range(60)]
    assert {item.known for item in found} <= {"at most", "measured"} and found[0].examples == 2
    truth = 0.05 / np.sqrt(2) / np.sqrt(1.01)
    bounds = [item.pixel_bias for item in found if item.known == "at most"]
    assert len(bounds) > 20 and min(bounds) > 0 and np.mean(np.array(bounds) > 0.98 * truth) > 0.9
    clear = _combined("s", [made(rng, bias=0.5)])
    assert clear.known == "measured" and clear.pixel_bias == pytest.approx(0.5 / np.sqrt(2) / np.sqrt(1.01), rel=0.05)


def test_noise_of_the_reference_leaves_a_bound() -> None:
    item = _combined("s", [made(np.random.default_rng(3), reference=0.3, noise=0.1)])
    assert item.known == "at most" and 0 < item.pixel_bias < 0.3


def test_of_a_black_layer_nothing_is_known() -> None:
    """And black examples are no reason to take the bias of others for smaller."""
    rng = np.random.default_rng(4)
    black, lit = made(rng, level=0.0), made(rng, bias=0.5)
    assert not black.known and lit.known
    unknown = _combined("s", [black, black])
    assert (unknown.known, unknown.examples, unknown.bias) == ("unknown", 0, 0.0)
    assert told_bias(unknown) == told_relmse(unknown) == ("unknown",) * 3
    assert _combined("s", [black, lit, black]) == _combined("s", [lit])


def test_a_small_object_has_the_bound_of_what_is_left() -> None:
    item = _combined("s", [made(np.random.default_rng(5), bias=0.5, side=12)])
    assert item.known == "at most" and item.pixel_bias**2 == pytest.approx(item.relmse_denoised, rel=1e-5)
    assert told_bias(item)[2].startswith("at most ")
