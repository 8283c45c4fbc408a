"""NumPy arrays -> Dr.Jit arrays in Dr.Jit's own memory."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np


def owned(dtype: Any, array: np.ndarray) -> Any:
    """A flat copy of `array` as `dtype`, aligned as Dr.Jit aligns.

    On the CPU Dr.Jit uses NumPy's memory in place. Its gathers of several neighbours at once need a wider alignment
    than NumPy keeps, so that the kernel, and with it the kernel cache, would depend on where an array happens to lie.
    """
    wrapped = dtype(np.ascontiguousarray(array).ravel())
    copy = dr.empty(dtype, dr.width(wrapped))
    dr.scatter(copy, wrapped, dr.arange(mi.UInt32, dr.width(wrapped)))
    dr.eval(copy)
    return copy
