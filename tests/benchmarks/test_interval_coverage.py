"""Intervals of coverages know that channels of a pixel stand or fall together, and tell cells that are off."""

import numpy as np

from benchmarks.coverage import told_apart
from benchmarks.transports.interval_coverage import confidence


def cell(random: np.random.Generator, share: float, pixels: int = 40, runs: int = 6) -> list[np.ndarray]:
    """Runs of three channels that agree."""
    return [np.repeat(random.random((pixels, 1)) < share, 3, axis=1) for _ in range(runs)]


def test_intervals_hold_the_share_as_often_as_they_say() -> None:
    """Of 1000 cells 96% at least: they are a little wide and hold 98%, so that one test in 10,000 fails. If channels
    counted as independent, 74% would be held."""
    random = np.random.default_rng(1)
    spans = np.array([confidence(cell(random, 0.9)) for _ in range(1000)])
    assert 0.96 <= np.mean((spans[:, 0] <= 0.9) & (spans[:, 1] >= 0.9)) < 1


def test_runs_that_err_together_widen_intervals() -> None:
    """Runs of 100 equal pixels each know no more than six values."""
    together = [np.full((100, 3), held) for held in (True, True, True, True, True, False)]
    least, most = confidence(together)
    assert most - least > 0.4


def test_all_held_is_not_certain() -> None:
    """Of 50 pixels that are all held, by hand: 0.025^(1/50)."""
    least, most = confidence([np.ones((50, 3), dtype=bool)])
    assert np.isclose(least, 0.025**(1 / 50)) and most == 1


def test_cells_that_are_off_are_named() -> None:
    random = np.random.default_rng(2)
    cells = {"sound": cell(random, 0.95), "low": cell(random, 0.75), "few": cell(random, 0.85, pixels=2, runs=2),
             "wide": cell(random, 1.0, pixels=300)}
    assert [line.split(":")[0] for line in told_apart(cells)] == ["low", "wide"]
