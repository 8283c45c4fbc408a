"""Pydantic's errors as one problem per broken rule: where, path, rule, value, nearest known key."""

import os
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from dataset_builder.errors import Problem
from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import TAG

Place = Callable[[tuple[str | int, ...]], str]
LONGEST_VALUE = 60
MAX_KNOWN = 20


def dotted(path: Iterable[str | int]) -> str:
    """A path of keys and indices as messages write it.

    >>> dotted(("splits", 0, "objects", "from", 1))
    'splits[0].objects.from[1]'
    """
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")


def shown(value: Any) -> str:
    """A value as its writer would recognise it, cut where it is long.

    >>> shown({"uniform": (0, True)}), shown(None), shown("abc")
    ('{uniform: [0, true]}', 'nothing', "'abc'")
    """
    text = flow(value)
    return text if len(text) <= LONGEST_VALUE else text[:LONGEST_VALUE - 3] + "..."


def flow(value: Any) -> str:
    """A value in YAML's flow style, whole.

    >>> flow({"kind": "orbit", "elevation": (0, 90)})
    "{kind: 'orbit', elevation: [0, 90]}"
    """
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(flow, value)) + "]"
    return repr(value)


def nearest(name: str, known: Sequence[str], what: str = "name") -> str:
    """A hint: the known name most like `name`, or else the path whose last part is, or all names where none is."""
    if close := get_close_matches(name, known, n=1):
        return f"nearest known {what}: {close[0]}"
    ends = {each.rpartition("/")[2]: each for each in reversed(known) if "/" in each}
    if close := get_close_matches(name.rpartition("/")[2], ends, n=1):
        return f"nearest known {what}: {ends[close[0]]}"
    listed = ", ".join(known[:MAX_KNOWN]) + (", ..." if len(known) > MAX_KNOWN else "")
    several = f"{what[:-1]}ies" if what.endswith("y") and not what.endswith("ey") else f"{what}s"
    return f"known {several}: {listed}" if known else ""


def name_alike(missing: Path) -> str:
    """A hint: the file whose name differs from that of a missing one in case or in how its accents are encoded."""
    def plain(name: str) -> str:
        return unicodedata.normalize("NFC", name).casefold()
    try:
        found = sorted(name for name in os.listdir(missing.parent) if plain(name) == plain(missing.name))
    except OSError:
        return ""
    if missing.name in found:
        return "what is there is no plain file that can be opened: a folder, a pipe, or a link to nothing"
    return f"{found[0]} is there: write its name as it is" if found else ""


def problems_of(error: ValidationError, model: type[Model], place: Place) -> list[Problem]:
    """Every broken rule of one file, in pydantic's order; `place` tells where a path was written."""
    details = error.errors(include_url=False)
    return [_problem(detail, model, place) for detail in details if not _follows_from_others(detail, details)]


def _follows_from_others(detail: ErrorDetails, details: list[ErrorDetails]) -> bool:
    """A tuple whose only items are wrong is reported as too short besides."""
    depth = len(detail["loc"])
    return detail["type"] == "too_short" and any(
        len(other["loc"]) > depth and other["loc"][:depth] == detail["loc"] for other in details)


def _problem(detail: ErrorDetails, model: type[Model], place: Place) -> Problem:
    context = detail.get("ctx", {})
    location = tuple(part for part in detail["loc"] if part != "[key]")
    path = (*(part for part in location if not str(part).startswith(TAG)), *context.get("path", ()))
    rule, hint = _rule(detail, context), _hint(detail, context, known_keys(model, location))
    return Problem(where=place(path), path=dotted(path), rule=rule, hint=hint)


_EXPECTED = {
    "float_type": "a number", "int_type": "a whole number", "string_type": "text", "bool_type": "true or false",
    "tuple_type": "a list", "dict_type": "a mapping", "model_type": "a mapping", "finite_number": "a finite number",
    "greater_than_equal": ">= {ge}", "greater_than": "> {gt}", "less_than_equal": "<= {le}", "less_than": "< {lt}",
    "too_short": "{min_length} or more entries", "too_long": "{max_length} or fewer entries",
    "string_too_long": "{max_length} or fewer characters",
    "string_pattern_mismatch": "text that matches {pattern}", "literal_error": "{expected}",
}


def _rule(detail: ErrorDetails, context: dict[str, Any]) -> str:
    """The expectation with its value."""
    kind, value = detail["type"], shown(detail["input"])
    if kind == "missing":
        return "expected a value, the key is missing"
    if kind == "extra_forbidden":
        return f"expected no such key, got {value}"
    if kind == "value_error":
        return str(context["error"])
    if kind == "broken":
        # Where a path leads on, the value holds the culprit, which the rule names
        return context["rule"] + (f", got {value}" if context["known"] and not context["path"] else "")
    if kind == "branch":
        return f"{detail['msg']}, got {value}"
    expected = _EXPECTED.get(kind)
    bounds = {name: int(bound) if isinstance(bound, float) and bound.is_integer() else bound
              for name, bound in context.items()}
    return f"expected {expected.format(**bounds)}, got {value}" if expected else f"{detail['msg']}, got {value}"


def _hint(detail: ErrorDetails, context: dict[str, Any], known: list[str]) -> str:
    """What the writer may have meant."""
    kind, value = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        return nearest(str(detail["loc"][-1]), known, "key")
    if kind == "literal_error" and isinstance(value, str):
        close = get_close_matches(value, context["expected"].replace("'", "").replace(" or ", ", ").split(", "), n=1)
        return f"nearest: {close[0]}" if close else ""
    if kind == "branch" and isinstance(value, dict) and "kind" in value:
        return nearest(str(value["kind"]), detail["msg"].rpartition("one of ")[2].split(", "), "kind")
    if kind == "branch" and isinstance(value, dict) and " kind is one of " in detail["msg"]:
        return "say which with `kind`"
    if kind == "branch" and isinstance(value, dict):
        return nearest(str(next(iter(value), "")), known, "key")
    return nearest(str(value), context["known"]) if context.get("known") else ""


def known_keys(model: type[Model], location: Sequence[str | int]) -> list[str]:
    """Keys that stand at `location` below `model`; the last part of a location may be an unknown key itself."""
    models = [model]
    for part in location:
        fields = [field for one in models for field in one.model_fields.items() if part in (field[0], field[1].alias)]
        if fields:
            models = [found for _, field in fields for found in _models_in((field.annotation, field.metadata))]
        elif isinstance(part, str) and part.startswith(TAG):
            models = [one for one in models if part[len(TAG):] in one.model_fields] or models
    return [field.alias or name for one in models for name, field in one.model_fields.items()]


def _models_in(annotation: Any) -> list[type[Model]]:
    """The models that an annotation mentions, however deep."""
    if isinstance(annotation, type) and issubclass(annotation, Model):
        return [annotation]
    parts = annotation if isinstance(annotation, tuple) else get_args(annotation)
    return [found for part in parts for found in _models_in(part)]
