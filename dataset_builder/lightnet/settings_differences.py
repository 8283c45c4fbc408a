"""Specs as flat lists of values by key, and the differences between two of them."""

from collections.abc import Mapping
from typing import Any

from dataset_builder.spec.model import Model


def differences(first: Model, second: Model) -> dict[str, tuple[Any, Any]]:
    """Dotted keys in which two specs of one kind differ, with both values."""
    one, two = flat(first), flat(second)
    return {key: (one[key], two[key]) for key in one if one[key] != two[key]}


def flat(spec: Model) -> dict[str, Any]:
    """Values by dotted key, as JSON has them."""
    return _flat(spec.model_dump(mode="json"))


def _flat(plain: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in plain.items():
        found |= _flat(value, f"{path}{key}.") if isinstance(value, dict) else {f"{path}{key}": value}
    return found
