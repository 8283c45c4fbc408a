"""The JSON member of an example: one text for one value, and one set of keys and types for a whole dataset.

Readers freeze the types of columns from the first few examples and then turn 1.7 into 1 without a word. So floats
always carry a decimal point, nothing is null, integers fit 53 bits (seeds are strings), and keys and types never vary.
"""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dataset_builder.errors import Problem, ShardError
from dataset_builder.label.example_label import ExampleLabel, LayerStatistics
from dataset_builder.shards.manifest import from_json

SCHEMA_VERSION = "1"
KEYS = frozenset(ExampleLabel.model_fields)
MAX_INTEGER = 2**53
MOST_BYTES = 2**24
"""Of a label."""


def encode_label(value: ExampleLabel | Mapping[str, Any]) -> bytes:
    """Canonical UTF-8 JSON of a label: sorted keys, no spaces, floats with a decimal point, a newline at the end.

    Raises ShardError for null, NaN, Inf, integers beyond 53 bits and types that are not plain data.
    """
    plain = value.model_dump(mode="json") if isinstance(value, ExampleLabel) else value
    return (_text(plain, "") + "\n").encode()


def parse_label(data: bytes, *, where: str, name: str) -> ExampleLabel:
    """The label in the file `name` of the shard `where`, with types. Keys that are not known are passed over, since
    later versions may add some.

    Raises ShardError where it is no JSON or too large, and with every key that is missing or wrong.
    """
    if len(data) > MOST_BYTES:
        raise ShardError([Problem(where=where, path=name, rule=_too_large(data))])
    return from_json(ExampleLabel, data, where=f"{where}: {name}", extra="ignore")


def read_label(data: bytes, *, where: str, name: str) -> dict[str, Any]:
    """The label in the file `name` of the shard `where`, as plain data.

    Raises ShardError where it is no JSON object with the keys of a label, is nested without end, or too large.
    """
    rule = _too_large(data)
    if len(data) <= MOST_BYTES:
        try:
            label = json.loads(data)
            if isinstance(label, dict) and set(label) == KEYS:
                return label
            rule = f"expected the keys {', '.join(sorted(KEYS))}"
        except (ValueError, RecursionError) as error:
            rule = f"expected JSON in {name} ({error})"
    raise ShardError([Problem(where=where, path=name, rule=rule)])


def statistics(array: np.ndarray) -> LayerStatistics:
    """Least, largest and mean value of an array; the mean to six digits, so that it is the same on every processor."""
    return LayerStatistics(min=float(array.min()), max=float(array.max()),
                           mean=float(f"{array.mean(dtype=np.float64):.6g}"))


def structure(value: Any, path: str = "") -> dict[str, str]:
    """Type of every key of plain data by dotted path; elements of a list share the path `key[]`.

    >>> structure({"a": [1.0, 2.0], "b": {"c": "x"}})
    {'': 'object', 'a': 'list', 'a[]': 'float', 'b': 'object', 'b.c': 'str'}
    """
    if isinstance(value, Mapping):
        found = {path: "object"}
        for key, item in value.items():
            found |= structure(item, f"{path}.{key}" if path else str(key))
        return found
    if isinstance(value, list | tuple):
        found = {path: "list"}
        for item in value:
            found |= {at: kind if found.get(at, kind) == kind else f"{found[at]} and {kind}"
                      for at, kind in structure(item, f"{path}[]").items()}
        return found
    return {path: type(value).__name__}


def differences(first: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """How the structure of one label differs from that of another, one sentence each; empty lists differ from none."""
    found = [f"expected {kind} at `{path}`, got {other[path]}" for path, kind in first.items()
             if path in other and other[path] != kind]
    for here, there, verb in ((first, other, "misses"), (other, first, "has an extra")):
        found += [f"{verb} key `{path}`" for path in here if path not in there and not _below_empty_list(path, there)]
    return found


def _below_empty_list(path: str, structure: Mapping[str, str]) -> bool:
    heads = [path[:i] for i in range(len(path)) if path.startswith("[]", i)]
    return any(structure.get(head) == "list" and f"{head}[]" not in structure for head in heads)


def _too_large(data: bytes) -> str:
    return f"expected a file of at most {MOST_BYTES} bytes, got {len(data)}"


def _text(value: Any, path: str) -> str:
    if isinstance(value, Mapping):
        items = (f"{_string(key, path)}:{_text(value[key], f'{path}.{key}')}" for key in sorted(value))
        return "{" + ",".join(items) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(_text(item, f"{path}[]") for item in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value, path)
    if type(value) is float and math.isfinite(value):
        return _float(value)
    if type(value) is int and abs(value) <= MAX_INTEGER:
        return str(value)
    raise _refused(path, value)


def _float(value: float) -> str:
    mantissa, exponent, power = repr(value).partition("e")
    return f"{mantissa}{exponent}{power}" if "." in mantissa else f"{mantissa}.0{exponent}{power}"


def _string(value: Any, path: str) -> str:
    if not isinstance(value, str):
        raise _refused(path, value)
    return json.dumps(value, ensure_ascii=False)


def _refused(path: str, value: Any) -> ShardError:
    kinds = "text, true, false, a finite float or an integer of 53 bits"
    rule = f"expected {kinds}, got {value!r} ({type(value).__name__})"
    return ShardError([Problem(where="label", path=path.lstrip("."), rule=rule)])
