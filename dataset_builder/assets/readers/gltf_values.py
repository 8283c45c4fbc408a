"""Values of a glTF file's JSON, taken only if they are what the format says: every error tells where it stands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.spec.problems import shown

LARGEST = 1e30
"""Of the numbers in the JSON; single precision ends at 3.4e38."""


@dataclass(frozen=True)
class Entry:
    """An object of the JSON. All methods raise UserError for values that are not what they are asked for."""

    value: Mapping[str, Any]
    at: str
    """Where it stands, such as `accessors[3]`."""
    path: Path

    def refuse(self, rule: str, hint: str = "", *, key: str = "") -> NoReturn:
        """Raise UserError about this entry, or about a key of it."""
        refuse(self.path, rule, hint, at=self._at(key))

    def _at(self, key: str) -> str:
        return ".".join(part for part in (self.at, key) if part)

    def has(self, key: str) -> bool:
        """Whether a key is there."""
        return key in self.value

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        value = self.value.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:
            self.refuse(f"expected a finite number, got {shown(value)}", key=key)
        return float(value)

    def integer(self, key: str, default: int | None = None, *, low: int = 0, high: int = 2**53) -> int:
        """A whole number in [low, high]; needed where there is no default."""
        value = self.value.get(key, default)
        whole = isinstance(value, int | float) and not isinstance(value, bool) and value == value // 1
        if not whole or not low <= value <= high:
            self.refuse(f"expected a whole number in [{low}, {high}], got {shown(value)}", key=key)
        return int(value)

    def index(self, key: str, among: Sequence[Any], what: str) -> int | None:
        """An index into `among`, None where the key is missing."""
        if key not in self.value:
            return None
        if not among:
            self.refuse(f"expected no such key, since the file has no {what}", key=key)
        return self.integer(key, high=len(among) - 1)

    def numbers(self, key: str, default: Sequence[float], *, count: int | None = None) -> np.ndarray:
        """(N,) float64, as many as `count`, or else as the default has."""
        value = self.value.get(key, default)
        good = isinstance(value, list | tuple) and len(value) == (len(default) if count is None else count)
        if not good or not all(isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < LARGEST
                               for x in value):
            self.refuse(f"expected {count or len(default)} finite numbers, got {shown(value)}", key=key)
        return np.array(value, dtype=np.float64)

    def text(self, key: str, default: str = "") -> str:
        """A string."""
        value = self.value.get(key, default)
        if not isinstance(value, str):
            self.refuse(f"expected text, got {shown(value)}", key=key)
        return value

    def flag(self, key: str, default: bool = False) -> bool:
        """True or false."""
        value = self.value.get(key, default)
        if not isinstance(value, bool):
            self.refuse(f"expected true or false, got {shown(value)}", key=key)
        return value

    def entry(self, key: str) -> "Entry":
        """An object; without keys where it is missing."""
        value = self.value.get(key, {})
        if not isinstance(value, dict):
            self.refuse(f"expected an object, got {shown(value)}", key=key)
        return Entry(value, self._at(key), self.path)

    def entries(self, key: str) -> list["Entry"]:
        """A list of objects; empty where it is missing."""
        for number, value in enumerate(found := self._list(key)):
            if not isinstance(value, dict):
                self.refuse(f"expected an object, got {shown(value)}", key=f"{key}[{number}]")
        return [Entry(value, f"{self._at(key)}[{number}]", self.path) for number, value in enumerate(found)]

    def indices(self, key: str, among: Sequence[Any]) -> list[int]:
        """A list of indices into `among`; empty where it is missing."""
        found = self._list(key)
        if wrong := [x for x in found if isinstance(x, bool) or not isinstance(x, int) or not 0 <= x < len(among)]:
            self.refuse(f"expected whole numbers below {len(among)}, got {shown(wrong[0])}", key=key)
        return found

    def names(self, key: str) -> list[str]:
        """A list of strings; empty where it is missing."""
        found = self._list(key)
        if wrong := [x for x in found if not isinstance(x, str)]:
            self.refuse(f"expected names, got {shown(wrong[0])}", key=key)
        return found

    def _list(self, key: str) -> list[Any]:
        value = self.value.get(key, [])
        if not isinstance(value, list):
            self.refuse(f"expected a list, got {shown(value)}", key=key)
        return value

    def extension(self, name: str) -> "Entry | None":
        """What an extension says here, None where it says nothing."""
        extensions = self.entry("extensions")
        return extensions.entry(name) if extensions.has(name) else None

    @property
    def title(self) -> str:
        """The entry as messages call it: `meshes[2] 'seat'`."""
        name = self.value.get("name")
        return f"{self.at} {shown(name)}" if isinstance(name, str) and name else self.at
