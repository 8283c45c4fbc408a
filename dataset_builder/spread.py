"""A few of many, chosen evenly: which examples, points and pieces stand for the rest. Nothing here is random."""

from collections.abc import Sequence

import numpy as np


def spread_indices(count: int, wanted: int) -> list[int]:
    """`wanted` positions of `count`, spread evenly and in order; all of them where 0 or more than there are."""
    if wanted == 0 or wanted >= count:
        return list(range(count))
    return [(2 * i + 1) * count // (2 * wanted) for i in range(wanted)]


def spaced(count: int, most: int) -> np.ndarray:
    """Positions of at most `most` of `count` things, evenly spread from the first to the last. Plans hang on them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


def runs(count: int, wanted: int) -> list[range]:
    """`count` positions cut into `wanted` runs of neighbours, as long as each other but for one."""
    return [range(i * count // wanted, (i + 1) * count // wanted) for i in range(wanted)]


def shares(sizes: Sequence[int], wanted: int) -> list[int]:
    """`wanted` shared out among groups in proportion to their sizes: to each at least one, be it more in all, and no
    more than it holds."""
    found = [min(size, max(1, round(wanted * size / sum(sizes)))) for size in sizes]
    while sum(found) > max(wanted, len(sizes)):
        found[found.index(max(found))] -= 1
    while sum(found) < min(wanted, sum(sizes)):
        spare = [size - share for size, share in zip(sizes, found, strict=True)]
        found[spare.index(max(spare))] += 1
    return found
