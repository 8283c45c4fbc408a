"""Ask the GPU for more memory than there is; print what is said of it."""

import drjit as dr
import mitsuba as mi

from dataset_builder.errors import OutputError
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.device import memory_told

MOST = 1000
"""Blocks of 8 GiB: more than any GPU has."""

if __name__ == "__main__":
    activate("cuda")
    held = []
    try:
        with memory_told("00000000"):
            for _ in range(MOST):
                held.append(dr.empty(mi.Float, 2**31))
                dr.eval(held)
    except OutputError as error:
        print(error)
