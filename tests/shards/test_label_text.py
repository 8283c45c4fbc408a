import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dataset_builder.errors import ShardError
from dataset_builder.shards.label_text import differences, encode_label, statistics, structure


def test_text_is_canonical() -> None:
    value = {"b": [1.0, 1e-05, 1e22, -0.0], "a": True, "c": {"é": "x\n", "seed": "18446744073709551615"}, "n": 3}
    expected = '{"a":true,"b":[1.0,1.0e-05,1.0e+22,-0.0],"c":{"seed":"18446744073709551615","é":"x\\n"},"n":3}\n'
    assert encode_label(value) == expected.encode()


@given(st.floats(allow_nan=False, allow_infinity=False))
@settings(max_examples=200)
def test_floats_have_a_point_and_come_back(value: float) -> None:
    text = encode_label({"x": value}).decode()
    assert "." in text
    assert json.loads(text)["x"] == value and isinstance(json.loads(text)["x"], float)


@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), 2**53 + 1, np.float32(1), np.int64(1), b"x",
                                   {1: 2}], ids=repr)
def test_what_readers_would_change_is_refused(value: Any) -> None:
    with pytest.raises(ShardError, match=r"record\.deep"):
        encode_label({"record": {"deep": [value]}})


def test_statistics_are_exact_for_bounds() -> None:
    array = np.array([[[0.1], [0.3]]], np.float32)
    assert statistics(array).model_dump() == {"min": float(np.float32(0.1)), "max": float(np.float32(0.3)),
                                              "mean": 0.2}


def test_structures_differ_by_missing_keys_and_types() -> None:
    first = structure({"a": 1.0, "b": {"c": "x"}, "d": [{"e": 1}]})
    assert differences(first, structure({"a": 2.0, "b": {"c": ""}, "d": [{"e": 5}, {"e": 6}]})) == []
    assert differences(first, structure({"a": 2.0, "b": {"c": ""}, "d": []})) == []
    assert differences(structure({"a": 2.0, "b": {"c": ""}, "d": []}), first) == []
    assert differences(first, structure({"a": 2, "b": {"c": ""}, "d": []})) == ["expected float at `a`, got int"]
    assert differences(first, structure({"a": 2.0, "b": {}, "d": []})) == ["misses key `b.c`"]
    assert differences(first, structure({"a": 2.0, "b": {"c": "", "f": 1}, "d": []})) == ["has an extra key `b.f`"]
    assert differences(first, structure({"a": 2.0, "b": {"c": ""}, "d": [{"e": 1}, {"e": 2.0}]})) == [
        "expected int at `d[].e`, got int and float"]
