"""Silhouettes and shading of two meshes, in images made by hand."""

import numpy as np
import pytest

from dataset_builder.rendering.rough_images import overlap, relmse


def images(s: float = 0.5, s_prime: float = 0.6, error: float = 0.0) -> dict[str, np.ndarray]:
    """A row of four pixels: whole in both, whole in one, partial, empty; S and S' are wrong but for the first."""
    mask, mask_rough = (np.float32(row).reshape(1, 4, 1) for row in ((1, 1, 0.5, 0), (1, 0.25, 0.75, 0)))
    s_row, s_prime_row = (np.full((1, 4, 3), 100.0 * value, np.float32) for value in (1, 2))
    s_row[0, 0], s_prime_row[0, 0] = s, s_prime
    return {"mask": mask, "mask_rough": mask_rough, "s": s_row, "s_prime": s_prime_row,
            "s_se": np.full((1, 4, 3), error, np.float32), "s_prime_se": np.full((1, 4, 3), 2 * error, np.float32)}


def test_parts_of_pixels_overlap_in_part() -> None:
    found = images()
    assert overlap(found["mask"], found["mask_rough"]) == pytest.approx((1 + 0.25 + 0.5) / (1 + 1 + 0.75))
    assert overlap(found["mask"], found["mask"]) == 1 == overlap(np.zeros(3), np.zeros(3))
    assert overlap(np.array([1.0, 0]), np.array([0, 1.0])) == 0


def test_shading_is_compared_where_both_are_whole() -> None:
    assert relmse(images()) == pytest.approx((0.1**2 / 0.5**2,), rel=1e-5)


def test_what_noise_adds_is_taken_off() -> None:
    """Differences of 0.1 with variances 0.02^2 and 0.04^2; on average over noisy images of equal S and S', nothing."""
    assert relmse(images(error=0.02)) == pytest.approx(((0.1**2 - 0.02**2 - 0.04**2) / 0.25,), rel=1e-5)
    generator, shape = np.random.default_rng(0), (200, 200, 3)
    noisy = {"mask": np.ones((200, 200, 1)), "mask_rough": np.ones((200, 200, 1)),
             "s": 1 + 0.03 * generator.standard_normal(shape), "s_se": np.full(shape, 0.03),
             "s_prime": 1 + 0.04 * generator.standard_normal(shape), "s_prime_se": np.full(shape, 0.04)}
    found, = relmse(noisy)
    assert abs(found) < 0.05 * (0.03**2 + 0.04**2)


def test_nothing_is_said_of_shading_that_is_not_there_or_not_known() -> None:
    whole = images()
    assert relmse({name: whole[name] for name in ("mask", "mask_rough", "s", "s_se")}) == ()
    assert relmse(whole | {"mask": 0 * whole["mask"]}) == ()
    assert relmse(images(error=np.inf)) == () == relmse(images(s=0))
