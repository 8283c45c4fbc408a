"""Numbers for people: lengths of a millimetre as well as of a hundred metres, and none with an exponent."""

import numpy as np

FINE = 0.1
"""Metres below which a length has two digits that say something, not two decimals."""


def metres(value: float) -> str:
    """A length to read, such as `1.54` or `0.0016`, without its unit."""
    return f"{value:.2f}" if abs(value) >= FINE else plain(value, 2)


def plain(value: float, digits: int = 3) -> str:
    """A number with that many digits that say something, never as a power of ten."""
    return np.format_float_positional(float(f"{value:.{digits}g}"), trim="-")
