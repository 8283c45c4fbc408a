"""Random numbers of lanes that have a number of their own, whoever else is traced beside them."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass
class LaneNumbers:
    """Independent uniform numbers. Has what paths ask of a Mitsuba sampler, and may be the state of a loop."""

    state: mi.PCG32

    @classmethod
    def of(cls, lanes: mi.UInt32, seed: int) -> LaneNumbers:
        """Those of numbered lanes. seed: 32 bits."""
        start, sequence = mi.sample_tea_32(lanes, dr.opaque(mi.UInt32, seed))
        return cls(state=mi.PCG32(initstate=mi.UInt64(start), initseq=mi.UInt64(sequence)))

    def next_1d(self, active: mi.Bool = True) -> mi.Float:
        """Uniform in [0, 1)."""
        return self.state.next_float32(active)

    def next_2d(self, active: mi.Bool = True) -> mi.Point2f:
        """Two of them."""
        first = self.next_1d(active)
        return mi.Point2f(first, self.next_1d(active))
