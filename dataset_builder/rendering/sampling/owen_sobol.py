"""Owen-scrambled Sobol points: stratified random numbers for every batch, in every pair of dimensions at once.

Dimensions come in groups of four. In each a batch takes the first points of Sobol's sequence (Joe and Kuo, SIAM Journal
on Scientific Computing 30, 2008) in an order of its own, scrambled in the manner of Owen by a hash (Laine and Karras,
"Stratified sampling for stochastic transparency", 2011; Burley, "Practical hash-based Owen scrambling", JCGT 9(4),
2020). The first two dimensions of a group are a (0,2)-sequence: 2^m points have one in every rectangle of area 2^-m
that halving makes. Scrambles of different batches and groups have nothing in common, so batches are independent.

Mitsuba's `multijitter` will not do for small batches: it permutes few strata so unevenly that numbers of different
calls correlate, by up to -0.08 in batches of 4 and -0.27 in batches of 2, and means of pictures are off by 0.1%.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.stats import qmc

from dataset_builder.rendering.buffers import owned

POINTS = 1 << 10
"""Most samples in a batch."""

GROUP = 4
"""Dimensions that are stratified together."""

BITS = 32


@dataclass
class OwenSobol:
    """One sample per lane. Has what paths ask of a Mitsuba sampler, and may be the state of a loop."""

    points: mi.UInt32
    """`sobol_points`, row by row."""
    index: mi.UInt32
    """Number of the sample in its batch."""
    scramble: mi.UInt32
    """Seed of the batch."""
    dimension: mi.UInt32
    """Numbers drawn so far."""

    @classmethod
    def of_batches(cls, per_batch: int, lanes: int, seed: int) -> OwenSobol:
        """Samples of a batch are next to each other. per_batch: 1 to POINTS; seed: 64 bits. Raises ValueError for other
        sizes of batches."""
        if not 1 <= per_batch <= POINTS:
            raise ValueError(f"per_batch: expected 1 to {POINTS}, got {per_batch}")
        lane, size = dr.arange(mi.UInt32, lanes), dr.opaque(mi.UInt32, per_batch)
        batch = lane // size
        high, low = (dr.opaque(mi.UInt32, part) for part in (seed >> BITS, seed & 0xFFFFFFFF))
        return cls(points=owned(mi.UInt32, sobol_points().ravel()), index=lane - batch * size,
                   scramble=mi.sample_tea_32(mi.sample_tea_32(batch, low)[0], high)[0], dimension=mi.UInt32(0))

    def next_1d(self, active: mi.Bool = True) -> mi.Float:
        """Uniform in [0, 1), with 24 bits."""
        group, column = self.dimension // GROUP, self.dimension % GROUP
        place = _scrambled(dr.brev(self.index), _hashed(self.scramble + (2 * group + 1) * 0x9E3779B9))
        point = dr.gather(mi.UInt32, self.points, (place % POINTS) * GROUP + column)
        value = _scrambled(point, _hashed(self.scramble ^ ((self.dimension + 1) * 0x85EBCA6B)))
        self.dimension = self.dimension + 1
        return mi.Float(value >> 8) * mi.Float(2**-24)

    def next_2d(self, active: mi.Bool = True) -> mi.Point2f:
        """A pair that is stratified together; the first or the second of a group."""
        self.dimension = (self.dimension + 1) & ~mi.UInt32(1)
        first = self.next_1d()
        return mi.Point2f(first, self.next_1d())


@cache
def sobol_points() -> np.ndarray:
    """(POINTS, GROUP) uint32, digits of Sobol's points from the lowest bit up."""
    digits = np.round(qmc.Sobol(d=GROUP, scramble=False, bits=30).random(POINTS) * 2.0**BITS).astype(np.uint32)
    found = np.zeros_like(digits)
    for bit in range(BITS):
        found |= (digits >> np.uint32(bit) & np.uint32(1)) << np.uint32(BITS - 1 - bit)
    return found


def _scrambled(reversed_digits: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """Digits from the lowest bit up, each flipped or not by a hash of those below it, turned round: a nested uniform
    scramble. The hash is Laine's and Karras', with the constants that N. Vegdahl found."""
    x = mi.UInt32(reversed_digits)
    x ^= x * 0x3D20ADEA
    x += seed
    x *= (seed >> 16) | 1
    x ^= x * 0x05526C56
    x ^= x * 0x53A22864
    return dr.brev(x)


def _hashed(x: mi.UInt32) -> mi.UInt32:
    """32 bits to 32, one to one: C. Wellons' `lowbias32`."""
    x ^= x >> 16
    x *= 0x7FEB352D
    x ^= x >> 15
    x *= 0x846CA68B
    return x ^ (x >> 16)
