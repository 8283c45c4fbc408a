"""Means of texels over the boxes of a coarser grid."""

import numpy as np


def averaged(values: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W) or (H, W, C) values as means over the boxes of a smaller grid of `size` (height, width); a value that two
    boxes share counts in each by its part. Keeps the mean of all values. float32.

    Values of float16, which scenes from files have, are added up in whole boxes where the grid divides theirs: ten
    times as fast as weighing them, and equal but for rounding.

    >>> averaged(np.array([[0, 3, 6]]), (1, 2))
    array([[1., 5.]], dtype=float32)
    """
    if values.dtype == np.float16 and not values.shape[0] % size[0] and not values.shape[1] % size[1]:
        return _box_means(values, size)
    rows = _averaged_rows(np.asarray(values, dtype=np.float32), size[0])
    return np.swapaxes(_averaged_rows(np.swapaxes(rows, 0, 1), size[1]), 0, 1)


def _box_means(values: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Means over whole boxes. Rows are added up first: they are one piece of memory."""
    high, wide = values.shape[0] // size[0], values.shape[1] // size[1]
    rows = values.reshape(size[0], high, -1).sum(axis=1, dtype=np.float32)
    sums = rows.reshape(size[0], size[1], wide, *values.shape[2:]).sum(axis=2)
    return sums / np.float32(high * wide)


def _averaged_rows(values: np.ndarray, count: int) -> np.ndarray:
    """Means over `count` equal stretches of the first axis."""
    length = values.shape[0]
    if count == length:
        return values
    means = np.empty((count, *values.shape[1:]), dtype=np.float32)
    for i in range(count):
        low, high = i * length / count, (i + 1) * length / count
        first, last = int(low), min(int(np.ceil(high)), length)
        index = np.arange(first, last)
        covered = np.minimum(index + 1, high) - np.maximum(index, low)
        means[i] = np.tensordot((covered / covered.sum()).astype(np.float32), values[first:last], axes=1)
    return means
