"""Numbers of a spec: constants and distributions."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from dataset_builder.seeding import rng
from dataset_builder.spec.load import read_text
from dataset_builder.spec.numbers import AnyNumber, draw, support, within

NUMBER: TypeAdapter[AnyNumber] = TypeAdapter(AnyNumber)
finite = st.floats(-1e6, 1e6)
positive = st.floats(1e-6, 1e6)
written = st.one_of(
    finite,
    st.tuples(finite, finite).map(lambda pair: {"uniform": sorted(pair)}),
    st.tuples(positive, positive).map(lambda pair: {"log_uniform": sorted(pair)}),
    st.tuples(finite, positive).map(lambda pair: {"normal": list(pair)}),
    st.lists(finite, min_size=1, max_size=4).map(lambda values: {"choice": values}),
)


@given(written)
def test_written_numbers_come_back(value: object) -> None:
    number = NUMBER.validate_python(read_text(json.dumps(value), "x").data, strict=True)
    assert NUMBER.dump_python(number, mode="json") == value


@given(written, st.integers(0, 2**32))
def test_draws_lie_in_their_support(value: object, seed: int) -> None:
    number = NUMBER.validate_python(value)
    low, high = support(number)
    assert low <= draw(number, rng(seed, "x")) <= high


@pytest.mark.parametrize(("value", "mean", "deviation"), [
    ({"uniform": [2, 4]}, 3, 2 / 12**0.5),
    ({"log_uniform": [1, np.e]}, np.e - 1, ((np.e**2 - 1) / 2 - (np.e - 1) ** 2) ** 0.5),
    ({"normal": [5, 0.5]}, 5, 0.5),
    ({"choice": [1, 1, 4]}, 2, 2**0.5),
    (7, 7, 0),
])
def test_moments(value: object, mean: float, deviation: float) -> None:
    number, generator, count = NUMBER.validate_python(value), rng(0, "moments"), 4000
    draws = np.array([draw(number, generator) for _ in range(count)])
    assert draws.mean() == pytest.approx(mean, abs=4.5 * deviation / count**0.5)
    assert draws.std() == pytest.approx(deviation, rel=0.06)


@pytest.mark.parametrize(("value", "message"), [
    ({"uniform": [2, 1]}, "expected low <= high, got [2, 1]"),
    ({"uniform": [1]}, "expected two numbers, got 1"),
    ({"log_uniform": [0, 1]}, "expected bounds > 0, got [0, 1]"),
    ({"normal": [0, -1]}, "expected a standard deviation >= 0, got -1"),
    ({"normal": [0, float("nan")]}, "finite"),
    ({"choice": []}, "at least 1"),
    (float("inf"), "finite"),
    (True, "expected a number or one of uniform, log_uniform, normal, choice"),
    (None, "expected a number or one of uniform, log_uniform, normal, choice"),
    ({}, "expected a number or one of uniform, log_uniform, normal, choice"),
])
def test_bad_numbers_break_one_rule(value: object, message: str) -> None:
    with pytest.raises(ValidationError) as caught:
        NUMBER.validate_python(value)
    assert caught.value.error_count() == 1
    assert message in str(caught.value)


@pytest.mark.parametrize(("value", "fits"), [
    (0, True), (1, True), (-0.01, False), ({"uniform": [0, 1]}, True), ({"uniform": [0, 1.01]}, False),
    ({"normal": [0.5, 0.125]}, True), ({"normal": [0.5, 0.13]}, False), ({"choice": [0.5, 2]}, False),
])
def test_the_whole_support_must_fit(value: object, fits: bool) -> None:
    adapter = TypeAdapter(within(low=0, high=1))
    if fits:
        adapter.validate_python(value)
    else:
        with pytest.raises(ValidationError, match=r"expected in \[0, 1\]"):
            adapter.validate_python(value)
