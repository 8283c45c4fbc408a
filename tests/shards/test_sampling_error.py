"""The error of D between two passes, which the gate radiance_split allows for."""

from unittest import mock

import numpy as np
import pytest

from dataset_builder.shards import gates as gates_module
from dataset_builder.shards.gates import check_gates, one_more, sampling_error
from dataset_builder.spec.dataset import GatesSpec


def test_the_error_of_a_difference_of_means_by_hand() -> None:
    """(1/4 + 1/12) 4/3 = 4/9: the deviation is that of 4 samples about their own mean."""
    assert sampling_error(4, 12) == pytest.approx(2 / 3)


def test_its_mean_square_is_the_variance_of_the_difference() -> None:
    random = np.random.default_rng(2)
    first, other = random.random((20_000, 4)), random.random((20_000, 12))
    difference = first.mean(axis=1) - other.mean(axis=1)
    expected = np.mean((sampling_error(4, 12) * first.std(axis=1)) ** 2)
    assert np.mean(difference**2) == pytest.approx(expected, rel=0.05)


def test_one_more_sample_by_hand() -> None:
    """Four samples found 0.1 and one more would find 0.9: sqrt(4/5 x 0.64/5) = 0.32. Off the mask all of 0 to 1 may
    be, so that the pixel of 0.3 could be 0.7 off; one far away does not count."""
    d = np.array([[[0.9], [0.1], [0.1], [0.1], [0.3], [0.0]]], np.float32)
    mask = np.array([[[1.0], [1], [1], [1], [0.5], [0]]], np.float32)
    found = one_more(np.zeros_like(d), d, mask, 4)[0, :, 0]
    assert found == pytest.approx([0.32, 0.32, 0, 0.08, 0.28, 0.4])
    assert one_more(np.full_like(d, 0.5), d, mask, 4)[0, 2, 0] == pytest.approx(0.5 * np.sqrt(4 / 5))


def slivers(loss: float) -> dict[str, np.ndarray]:
    """Evidence of a disc of albedo 0.2 under even light, and of 0.9 around it, on one mask: d of 16 samples of a pixel,
    the rest of 1024 in four batches. loss: share of the light that is missing inside the disc."""
    random, rows = np.random.default_rng(5), np.arange(100)[:, None, None]

    def albedo(samples: int) -> np.ndarray:
        y, x = (random.random((samples, 100, 100)) + at for at in (rows.transpose(1, 0, 2), rows.transpose(1, 2, 0)))
        return np.where(np.hypot(x - 50, y - 50) < 30, 0.2, 0.9)[..., None]

    first = albedo(16)
    batches = np.stack([albedo(256).mean(axis=0) for _ in range(4)])
    zero, off = np.zeros((100, 100, 1), np.float32), np.where(first.max(axis=0) < 0.5, 1 - loss, 1.0)
    return {name: zero for name in ("spec", "spec_se", "s_se", "sd_s")} | {
        "s": zero + 3, "d": first.mean(axis=0), "sd_d": first.std(axis=0), "i_t": 3 * off * batches.mean(axis=0),
        "i_t_se": 3 * batches.std(axis=0, ddof=1) / 2, "mask": zero + 1}


def test_slivers_that_few_samples_missed_reject_no_example() -> None:
    """Of pixels that the outline crosses, 16 samples miss what takes less than a tenth of them in one of three; 1024
    meet it, and know to what share. Light that is lost, a hundredth of it inside the disc, is found all the same."""
    gates = GatesSpec(coverage=(0, 1))
    sound, lossy = slivers(0.0), slivers(0.01)
    assert check_gates({}, gates, sound, (16, 1024)) == []
    assert check_gates({}, gates, lossy, (16, 1024)) != []
    with mock.patch.object(gates_module, "one_more", lambda sd_d, *_: sd_d):
        assert check_gates({}, gates, sound, (16, 1024)) != []
