"""Values of a 3D-FRONT scene, taken as far as they are what the format says; what is wrong is noted and lived with."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot
from typing import Any

import numpy as np

from dataset_builder.errors import printable
from dataset_builder.spec.front3d_references import ARRAYS
from dataset_builder.spec.problems import shown

FURTHEST = 1e4
"""Metres from the origin at which nothing of a house stands."""
FLATTEST = 1e-5
"""Scales below are none (ATISS drops rooms that have them)."""
UNEVEN = 1e-3
"""How far the norm of a rotation may be from 1 without a word: files have five digits."""


@dataclass(frozen=True)
class SceneFault:
    """Something wrong with a scene that was lived with."""

    kind: str
    """What is wrong and what became of it, the same words for all of a kind."""
    where: str
    """The thing or the entry of the file."""
    said: str = ""
    """The value, or more of the story."""


@dataclass(frozen=True, eq=False)
class LongList:
    """A long list of numbers of a mesh."""

    values: np.ndarray
    """(N,) float64, NaN for what is no number."""
    texts: int
    """How many are written as text."""


def with_arrays(entry: dict[str, Any]) -> dict[str, Any]:
    """The entry with its long lists as arrays, as soon as it is read: numbers of Python take four times the memory.
    Normals, which are no directions in these files, go."""
    entry.pop("normal", None)
    for key in ARRAYS:
        if isinstance(value := entry.get(key), list):
            entry[key] = _long_list(value)
    return entry


def _long_list(values: list[Any]) -> LongList:
    if len(values) and isinstance(values[0], list):
        values = [each for row in values for each in (row if isinstance(row, list) else [row])]
    if set(map(type, values)) <= {float, int}:
        try:
            return LongList(np.array(values, dtype=np.float64), 0)
        except OverflowError:
            pass
    return LongList(np.array([number(value) for value in values], dtype=np.float64),
                    sum(isinstance(value, str) for value in values))


def number(value: Any) -> float:
    """A number, or one written as text; NaN for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return np.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return np.nan


def cleaned(value: Any, longest: int = 100) -> str:
    """Text, or a number as text, on one line and not too long; empty for anything else."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return ""
    text = value[:longest] if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else shown(value)
    return printable(text.encode("utf-8", "replace").decode()).strip()


@dataclass
class FaultNotes:
    """Faults in the order in which they are met."""

    found: list[SceneFault] = field(default_factory=list)

    def add(self, kind: str, where: str, said: str = "") -> None:
        """Note a fault."""
        self.found.append(SceneFault(kind, where, said))

    def entries(self, owner: Mapping[str, Any], key: str, where: str = "") -> list[tuple[str, dict[str, Any]]]:
        """The objects of a list with their places, such as `mesh[3]`; others are noted. Empty where it is missing."""
        value = owner.get(key)
        place = f"{where}.{key}" if where else key
        if not isinstance(value, list):
            if value is not None:
                self.add("lists that are none, left out", place, shown(value))
            return []
        wrong = [index for index, each in enumerate(value) if not isinstance(each, dict)]
        for index in wrong:
            self.add("entries that are no objects, left out", f"{place}[{index}]", shown(value[index]))
        return [(f"{place}[{index}]", each) for index, each in enumerate(value) if isinstance(each, dict)]

    def mapping(self, owner: Mapping[str, Any], key: str) -> dict[str, Any]:
        """An object; empty where it is missing or is none."""
        value = owner.get(key)
        if value is not None and not isinstance(value, dict):
            self.add("objects that are none, left out", key, shown(value))
        return value if isinstance(value, dict) else {}

    def placement(self, entry: Mapping[str, Any], where: str) -> np.ndarray | None:
        """(4, 4) of scale, then rotation, then translation, in the file's axes; None for what is none, which is noted.
        Missing keys change nothing."""
        parts = {key: self._triple(entry, key, default, where)
                 for key, default in (("pos", (0, 0, 0)), ("rot", (0, 0, 0, 1)), ("scale", (1, 1, 1)))}
        position, rotation, scale = parts["pos"], parts["rot"], parts["scale"]
        if position is None or rotation is None or scale is None:
            return None
        norm = hypot(*rotation)
        if not np.abs(position).max() < FURTHEST:
            self.add("places further than 10 km, left out", where, shown(position.tolist()))
        elif not 1e-6 < norm < 1e6:
            self.add("rotations that are none, left out", where, shown(rotation.tolist()))
        elif not FLATTEST <= np.abs(scale).min() <= np.abs(scale).max() < FURTHEST:
            self.add("scales near 0 or without end, left out", where, shown(scale.tolist()))
        else:
            if abs(norm - 1) > UNEVEN:
                self.add("rotations of another length than 1, made 1", where, f"{norm:.4g}")
            matrix = np.eye(4)
            matrix[:3, :3] = rotation_matrix(rotation / norm) * scale
            matrix[:3, 3] = position
            return matrix
        return None

    def _triple(self, entry: Mapping[str, Any], key: str, default: tuple[int, ...], where: str) -> np.ndarray | None:
        """(3,) or (4,) finite numbers."""
        value = entry.get(key)
        if value is None:
            if key not in entry:
                self.add("placements without all of pos, rot and scale, taken for none", where, f"no {key}")
                return np.array(default, dtype=np.float64)
            value = ()
        found = np.array([number(each) for each in value]) if isinstance(value, list) else np.zeros(0)
        if found.shape != (len(default),) or not np.isfinite(found).all():
            self.add("placements that are no numbers, left out", where, f"{key} {shown(value)}")
            return None
        if any(isinstance(each, str) for each in value):
            self.add("numbers written as text, read", where, key)
        return found


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) of a unit quaternion x, y, z, w: R v = v + 2 w (u x v) + 2 u x (u x v), with u = (x, y, z)."""
    x, y, z, w = quaternion
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * across + 2 * across @ across
