"""A file of a spec as plain data that remembers the line of every key, and how overrides edit it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import ValidationError

from dataset_builder.errors import Problem
from dataset_builder.spec.model import Model
from dataset_builder.spec.problems import dotted, nearest, problems_of, shown

Path = tuple[str | int, ...]
AnyModel = TypeVar("AnyModel", bound=Model)


@dataclass(frozen=True, kw_only=True)
class Document:
    """Plain data (dict, tuple, str, int, float, bool, None) and where each path of keys and indices was written."""

    name: str
    """File as messages name it."""
    data: Any
    places: dict[Path, str]
    """`file:line` or the override that wrote it; paths without an entry have that of the nearest path above."""

    def place(self, path: Path) -> str:
        """Where `path` was written."""
        while path and path not in self.places:
            path = path[:-1]
        return self.places.get(path, self.name)

    def problem(self, path: Path, rule: str, hint: str = "") -> Problem:
        """A broken rule of what stands at `path`."""
        return Problem(where=self.place(path), path=dotted(path), rule=rule, hint=hint)


@dataclass(frozen=True, kw_only=True)
class Override:
    """A value for one path of a dataset file, as `--set splits.train.views=2` gives it."""

    text: str
    keys: tuple[str, ...]
    value: Any

    @property
    def where(self) -> str:
        """How messages name it."""
        return f"--set {self.text}"


class BadOverride(Exception):
    """An override whose path leads nowhere; holds the problem."""

    def __init__(self, problem: Problem):
        super().__init__(str(problem))
        self.problem = problem


def apply(document: Document, override: Override) -> Document:
    """The document with one value replaced or added. Raises BadOverride where the path leads nowhere."""
    places = dict(document.places)
    data, path = _edited(document.data, (), override, places)
    kept = {old: place for old, place in places.items() if old[:len(path)] != path}
    return Document(name=document.name, data=data, places=kept | {path: override.where})


def _edited(data: Any, path: Path, override: Override, places: dict[Path, str]) -> tuple[Any, Path]:
    """The data below `path` with the override's value in place, and the whole path to that value."""
    if len(path) == len(override.keys):
        return override.value, path
    key = override.keys[len(path)]
    if isinstance(data, dict):
        # Keys that the file leaves out are made on the way; validation knows which of them exist
        if key not in data:
            places[(*path, key)] = override.where
        value, whole = _edited(data.get(key, {}), (*path, key), override, places)
        return {**data, key: value}, whole
    if isinstance(data, tuple):
        index = _index(data, key, path, override)
        value, whole = _edited(data[index], (*path, index), override, places)
        return (*data[:index], value, *data[index + 1:]), whole
    raise BadOverride(Problem(where=override.where, path=dotted(path),
                              rule=f"expected a mapping or a list to look up '{key}' in, got {shown(data)}",
                              hint="set the whole value instead, such as " + dotted(path) + "={uniform: [0, 1]}"))


def _index(items: tuple[Any, ...], key: str, path: Path, override: Override) -> int:
    """Index of the list item that `key` means: its number, or its `name`."""
    names = [item.get("name") if isinstance(item, dict) else None for item in items]
    if key in names:
        return names.index(key)
    if key.isdecimal() and int(key) < len(items):
        return int(key)
    known = [str(name) for name in names if name is not None]
    rule = f"expected an index below {len(items)}{' or a name' if known else ''}, got '{key}'"
    raise BadOverride(Problem(where=override.where, path=dotted(path), rule=rule, hint=nearest(key, known)))


def validated(document: Document, model: type[AnyModel]) -> AnyModel | list[Problem]:
    """The model that a file means, or every rule that it breaks. Types are strict: "5" is no number, true is not 1."""
    try:
        return model.model_validate(document.data, strict=True)
    except ValidationError as error:
        return problems_of(error, model, document.place)


def value_at(data: Any, key: str) -> Any:
    """What plain data holds under a key; None where it is no mapping, or has no such key."""
    return data.get(key) if isinstance(data, dict) else None


def items_of(data: Any) -> Iterator[tuple[int, Any]]:
    """The items of a list of plain data with their indices; none where it is no list."""
    return enumerate(data if isinstance(data, tuple) else ())
