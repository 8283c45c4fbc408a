"""Randomness as an argument, derived from a path and never from call order.

`rng(7, "train", 3, "camera")` depends on its arguments alone, so that adding an object, a light or a noise level moves
no other draw. Seed 0 is a valid seed.
"""

import hashlib

import numpy as np

SEED_BITS = 64


def derive_seed(seed: int, *path: str | int) -> int:
    """Unsigned 64-bit seed of the stream named `path` below `seed` (0 <= seed < 2**64).

    >>> derive_seed(0, "train", 3) == derive_seed(0, "train", 3) != derive_seed(0, "train", "3")
    True
    """
    if not 0 <= seed < 2**SEED_BITS:
        raise ValueError(f"expected 0 <= seed < 2**{SEED_BITS}, got {seed}")
    text = repr((seed, *path)).encode()
    return int.from_bytes(hashlib.blake2b(text, digest_size=SEED_BITS // 8).digest(), "little")


def rng(seed: int, *path: str | int) -> np.random.Generator:
    """Generator of the stream named `path` below `seed`; PCG64, whose draws NumPy keeps stable per method."""
    return np.random.Generator(np.random.PCG64(derive_seed(seed, *path)))
