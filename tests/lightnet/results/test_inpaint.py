"""Filled pixels are those asked for, come from known ones alone, and cost no more than a bound."""

from time import perf_counter

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.lightnet.results import inpaint
from dataset_builder.lightnet.results.inpaint import fill
from dataset_builder.seeding import rng

SIZE = 40
ROWS, COLUMNS = np.mgrid[:SIZE, :SIZE]


def disc(radius: float) -> np.ndarray:
    """(H, W) bool, about the middle."""
    return np.hypot(ROWS - SIZE / 2, COLUMNS - SIZE / 2) < radius


def picture(seed: int = 0) -> np.ndarray:
    """(H, W, 3) noise in [0, 1)."""
    return rng(seed, "picture").uniform(0, 1, (SIZE, SIZE, 3)).astype(np.float32)


def ramp() -> np.ndarray:
    """(H, W, 3) planes of different slopes."""
    return np.stack([0.2 + 0.01 * ROWS, 0.9 - 0.015 * COLUMNS, 0.1 + 0.005 * (ROWS + COLUMNS)],
                    axis=-1).astype(np.float32)


def test_only_what_was_asked_for_changes() -> None:
    before, known, asked = picture(), disc(10), disc(13) & ~disc(10)
    asked[4, 20] = asked[33, 8] = True
    after = fill(before, known, asked)
    changed = (after != before).any(axis=-1)
    assert np.array_equal(changed, asked)
    assert before.tobytes() == picture().tobytes()


def test_known_pixels_stay_even_if_asked_for() -> None:
    before = picture()
    assert np.array_equal(fill(before, disc(10), disc(10)), before)
    assert np.array_equal(fill(before, disc(10), disc(12))[disc(10)], before[disc(10)])


def test_nothing_else_than_known_pixels_matters() -> None:
    known, asked = disc(10), disc(13) & ~disc(10)
    one = picture()
    other = np.where(known[..., None], one, np.float32(np.nan))
    assert np.array_equal(fill(one, known, asked)[asked], fill(other, known, asked)[asked])


@pytest.mark.parametrize("value", [0.0, 0.25, 0.7])
def test_a_constant_rim_stays_constant_beside_a_bright_background(value: float) -> None:
    known, asked = disc(10), disc(14) & ~disc(10)
    before = np.where(known[..., None], np.float32(value), np.float32(1)).repeat(3, axis=-1)
    assert np.abs(fill(before, known, asked)[asked] - value).max() < 1e-6


def test_planes_go_on_through_holes() -> None:
    """The biharmonic surface through a plane is that plane."""
    known = ~(disc(4) | (disc(13) & ~disc(11)))
    holed = np.where(known[..., None], ramp(), 0)
    assert np.abs(fill(holed, known, ~known) - ramp()).max() < 1e-5


def test_values_stay_among_the_known() -> None:
    before = picture(3)
    known, asked = disc(10) & (before[..., 0] > 0.4), disc(15)
    after = fill(before, known, asked)[asked & ~known]
    low, high = before[known].min(axis=0), before[known].max(axis=0)
    assert (after >= low - 1e-6).all() and (after <= high + 1e-6).all()


def test_it_is_smoother_than_the_nearest_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    smooth = np.stack([np.sin(ROWS / 6 + COLUMNS / 9) / 2 + 0.5] * 3, axis=-1).astype(np.float32)
    known = ~disc(5)
    error = np.abs(fill(smooth, known, ~known) - smooth).max()
    monkeypatch.setattr(inpaint, "REACH", 0.0)
    nearest = np.abs(fill(smooth, known, ~known) - smooth).max()
    assert error < 0.05 < 0.2 < nearest


def test_far_pixels_take_the_nearest_value() -> None:
    known = COLUMNS < 5
    after = fill(ramp(), known, ~known)
    far = COLUMNS > 4 + inpaint.REACH
    assert np.array_equal(after[far], ramp()[:, 4:5].repeat(SIZE, axis=1)[far])


def test_no_more_is_solved_than_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    solved = list[int]()
    original = inpaint.inpaint_biharmonic

    def counted(around: np.ndarray, mask: np.ndarray, **options: object) -> np.ndarray:
        solved.append(int(mask.sum()))
        return original(around, mask, **options)

    monkeypatch.setattr(inpaint, "inpaint_biharmonic", counted)
    known, asked = disc(6), disc(16) & ~disc(6)
    whole = fill(picture(), known, asked)
    monkeypatch.setattr(inpaint, "MAX_PIXELS", 100)
    part = fill(picture(), known, asked)
    assert solved[0] == asked.sum() > 100 >= solved[1] > 0
    assert np.isfinite(part).all() and not np.array_equal(part, whole)


def test_a_rim_at_800_pixels_takes_a_moment() -> None:
    rows, columns = np.mgrid[:800, :800]
    distance = np.hypot(rows - 400, columns - 400)
    before = np.stack([np.sin(columns / 50)] * 3, axis=-1).astype(np.float32)
    begin = perf_counter()
    fill(before, distance < 300, distance < 302)
    assert perf_counter() - begin < 10


def test_nothing_known_is_told() -> None:
    with pytest.raises(UserError, match="expected at least one known pixel"):
        fill(picture(), np.zeros((SIZE, SIZE), bool), disc(5))
