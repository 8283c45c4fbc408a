"""Scrambled Sobol points: in every rectangle as many as belong there, in no relation to other batches."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.rendering.sampling.owen_sobol import GROUP, POINTS, OwenSobol, sobol_points

SEED = 0x1234567890ABCDEF


def pairs(per_batch, batches, seed=SEED, count=4):
    """(batches, per_batch, 2 count) numbers of the first `count` pairs."""
    sampler = OwenSobol.of_batches(per_batch, per_batch * batches, seed)
    drawn = [sampler.next_2d() for _ in range(count)]
    return np.stack([np.array(axis) for pair in drawn for axis in pair], axis=-1).reshape(batches, per_batch, -1)


def in_rectangles(points, log2):
    """Whether 2^log2 points (..., 2) have one in each rectangle of area 2^-log2 that halving makes."""
    for wide in range(log2 + 1):
        columns, rows = 2**wide, 2 ** (log2 - wide)
        cell = np.floor(points[..., 0] * columns) * rows + np.floor(points[..., 1] * rows)
        if not (np.sort(cell, axis=-1) == np.arange(2**log2)).all():
            return False
    return True


def test_points_are_a_0_2_sequence_before_they_are_scrambled():
    turned = np.array([[int(f"{digits:032b}"[::-1], 2) for digits in row] for row in sobol_points().tolist()]) / 2**32
    for log2 in range(11):
        assert in_rectangles(turned[:, :2].reshape(-1, 2**log2, 2), log2)


@pytest.mark.parametrize("log2", [0, 1, 2, 4, 6, 10])
def test_scrambled_batches_are_0_2_nets_in_the_first_pair_of_every_group(log2):
    points = pairs(2**log2, 32)
    for first in range(0, points.shape[-1], GROUP):
        assert in_rectangles(points[..., first:first + 2], log2)


def test_every_number_has_one_point_in_each_interval():
    points = pairs(64, 32)
    assert (np.sort(np.floor(points * 64), axis=1) == np.arange(64)[:, None]).all()


@pytest.mark.parametrize("per_batch", [1, 4, 9, 16, 64])
def test_numbers_are_uniform_and_no_two_of_them_are_related(per_batch):
    """Means, squares and products of all pairs of eight dimensions, over independent batches: 44 figures, |z| < 4.5
    each, so that one run in 3,000 fails by chance. Mitsuba's `multijitter` has |z| of 40 here."""
    points = pairs(per_batch, 1 << 16).astype(np.float64) - 0.5
    first, second = np.tril_indices(8)
    products = np.concatenate([points, points[..., first] * points[..., second]], axis=-1).mean(axis=1)
    truth = np.concatenate([np.zeros(8), np.where(first == second, 1 / 12, 0)])
    spread = np.maximum(products.std(axis=0) / np.sqrt(len(products)), 1e-7)
    assert np.abs((products.mean(axis=0) - truth) / spread).max() < 4.5


def test_batches_are_independent():
    """The first point of a batch says nothing of the first of the next: one false alarm in 10,000."""
    points = pairs(16, 1 << 14)[:, 0]
    for axis in range(points.shape[-1]):
        assert stats.spearmanr(points[0::2, axis], points[1::2, axis]).pvalue > 1e-4 / points.shape[-1]


def test_repetitions_have_equal_bits_and_other_seeds_other_numbers():
    assert np.array_equal(pairs(16, 8), pairs(16, 8))
    for other in (SEED + 1, SEED + (1 << 32)):
        assert np.isin(pairs(16, 8, other), pairs(16, 8)).mean() < 0.01


def test_all_batch_sizes_share_a_kernel():
    kernels = []
    for per_batch in (4, 9, 64):
        sampler = OwenSobol.of_batches(per_batch, 576, SEED)
        dr.eval(sampler.index, sampler.scramble)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            dr.eval(sampler.next_2d(), sampler.next_1d())
            kernels.append([entry["hash"] for entry in dr.kernel_history((dr.KernelType.JIT,))])
    assert kernels[0] and kernels[0] == kernels[1] == kernels[2]


def test_loops_draw_new_numbers():
    @dr.syntax
    def total(sampler: OwenSobol, times: int) -> mi.Float:
        k, found = mi.UInt32(0), mi.Float(0)
        while k < times:
            found += sampler.next_2d().y
            k += 1
        return found

    found = total(OwenSobol.of_batches(16, 64, SEED), dr.opaque(mi.UInt32, 4))
    assert np.allclose(found, pairs(16, 4)[..., 1::2].sum(-1).ravel())


@pytest.mark.parametrize("per_batch", [0, POINTS + 1])
def test_batches_that_the_sequence_has_no_points_for_are_refused(per_batch):
    with pytest.raises(ValueError, match=f"1 to {POINTS}"):
        OwenSobol.of_batches(per_batch, per_batch, SEED)
