"""Which examples make up a batch: a pure function of the seed and the number of the batch."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dataset_builder.seeding import rng


class Draw(NamedTuple):
    """Example number `example` as epoch `epoch` shows it."""

    epoch: int
    example: int


@lru_cache(maxsize=4)
def epoch_order(count: int, seed: int, epoch: int) -> np.ndarray:
    """(count,) every position once, shuffled anew in each epoch; not to be written to."""
    order = rng(seed, "order", epoch).permutation(count)
    order.flags.writeable = False
    return order


def draws_of(batch: int, *, size: int, count: int, seed: int) -> list[Draw]:
    """Batch number `batch`: positions [batch size, (batch + 1) size) of all epochs in a row, so that none is ragged."""
    places = (divmod(place, count) for place in range(batch * size, (batch + 1) * size))
    return [Draw(epoch=epoch, example=int(epoch_order(count, seed, epoch)[place])) for epoch, place in places]
