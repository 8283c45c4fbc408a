from itertools import chain

import numpy as np
import pytest

from dataset_builder.lightnet.data.batch_order import Draw, draws_of, epoch_order


def test_every_epoch_shows_every_example_once_in_an_order_of_its_own() -> None:
    orders = [epoch_order(50, 3, epoch) for epoch in range(4)]
    assert all(sorted(order) == list(range(50)) for order in orders)
    assert len({tuple(order) for order in orders}) == 4


@pytest.mark.parametrize("size", [1, 4, 7, 23])
def test_batches_are_the_epochs_in_a_row(size: int) -> None:
    """Batches larger than an epoch and epochs that batches do not divide, too: none is ragged, nothing is lost."""
    batches = [draws_of(batch, size=size, count=10, seed=5) for batch in range(30)]
    assert all(len(batch) == size for batch in batches)
    row = list(chain.from_iterable(batches))
    expected = [Draw(epoch=epoch, example=int(example)) for epoch in range(70) for example in epoch_order(10, 5, epoch)]
    assert row == expected[:30 * size]


def test_a_batch_depends_on_its_number_alone() -> None:
    later = draws_of(1000, size=8, count=30, seed=0)
    for batch in range(20):
        draws_of(batch, size=8, count=30, seed=0)
    assert draws_of(1000, size=8, count=30, seed=0) == later != draws_of(1000, size=8, count=30, seed=1)


def test_every_place_is_as_likely_for_every_example() -> None:
    """Chi-squared with 10 x 9 = 90 degrees of freedom over 2,000 epochs: above 150 once in 10,000 seeds."""
    counts = np.zeros((10, 10))
    for epoch in range(2000):
        counts[np.arange(10), epoch_order(10, 11, epoch)] += 1
    assert 40 < ((counts - 200) ** 2 / 200).sum() < 150


def test_an_order_is_not_to_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        epoch_order(5, 0, 0)[0] = 3
