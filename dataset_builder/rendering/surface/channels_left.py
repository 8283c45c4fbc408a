"""How much of each colour channel a path has left, as one number: a ray's time, which scenes that do not move have no
use for.

Dispersive glass sends each channel another way. A path that follows one of them has less left of the others, or
nothing, and picks the channel that it follows at the next crossing in proportion to what it has left: with c the
channels and p_c their densities, that is the density sum of p_c over whole paths, hero wavelength sampling (Wilkie et
al., "Hero wavelength spectral sampling", EGSR 2014), one crossing at a time.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

BITS = 8
"""Of each channel: what is left goes in steps from 0, nothing, to 2^BITS - 1, the most of any channel. Three such
numbers fit into the 24 bits of a float's mantissa."""


def pack(left: mi.Color3f, bits: int = BITS) -> mi.Float:
    """What a path has left of each channel, in units of the most; 0 where there is nothing. A channel of which anything
    is left has one level at least."""
    most = 2**bits - 1
    scale = dr.select(dr.max(left) > 0, most * dr.rcp(dr.max(left)), 0)
    red, green, blue = (dr.clip(dr.ceil(left[channel] * scale), 0, most) for channel in range(3))
    return dr.fma(dr.fma(blue, most + 1, green), most + 1, red)


def unpack(code: mi.Float, bits: int = BITS) -> mi.Color3f:
    """Whole numbers from 0 to 2^bits - 1 in proportion to what is left; ones for a code of 0, which rays have that come
    from a camera."""
    whole = mi.UInt32(code)
    levels = mi.Color3f(*(mi.Float((whole >> shift) & (2**bits - 1)) for shift in (0, bits, 2 * bits)))
    return dr.select(code > 0, levels, 1)


def kept(code: mi.Float) -> mi.Color3f:
    """1 in the channels of which anything is left, 0 in the others."""
    return dr.select(unpack(code) > 0, mi.Color3f(1), 0)
