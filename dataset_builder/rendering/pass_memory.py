"""What passes found, remembered by what they depend on: as bytes, in whatever store the caller has."""

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol
from zipfile import BadZipFile

import numpy as np

from dataset_builder.digest import digest
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.rendering.pass_inputs import inputs_of, key_of, shows_field, steps_of
from dataset_builder.rendering.sampling.adaptive import Sampled, Stop
from dataset_builder.rendering.sampling.moments import FIGURES, Estimate


class Store(Protocol):
    """Bytes by key; what was put may have gone."""

    def get(self, key: str) -> bytes | None:
        """The bytes of a key, or None."""

    def put(self, key: str, value: bytes) -> None:
        """Keep bytes under a key."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PassFound:
    """What a pass found so far."""

    pixels: np.ndarray
    """(P,) indices row * width + column, rising."""
    sampled: Sampled
    facts: Mapping[str, float] = field(default_factory=dict)
    """Figures of the geometry that labels need and that would otherwise be worked out from it again."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PassResult:
    """What one pass found."""

    pixels: np.ndarray
    """(P,) indices row * width + column, in rising order."""
    found: Estimate
    raw: Estimate
    """The same, each pixel's error as its own batches have it."""
    stopped: Mapping[str, Stop]
    """Why sampling of each layer with a goal ended."""
    facts: Mapping[str, float]
    """Figures of the geometry: `unit`, metres per unit of the local frame, and those of `Roughness` of the rough
    mesh."""


class PassMemory:
    """Results of passes in a store, under the versions that made them, and those of fields where a field is seen;
    without a store, nothing is remembered."""

    def __init__(self, store: Store | None, made_by: Mapping[str, str], field_made_by: Mapping[str, str] | None = None):
        self._store, self._made_by, self._field_made_by = store, dict(made_by), dict(field_made_by or {})

    def recall(self, plan: ExamplePlan, name: str) -> tuple[int, PassFound | None]:
        """Steps of a pass that are known, as many as possible, and what they found."""
        if self._store is None:
            return 0, None
        for steps in range(steps_of(plan, name), 0, -1):
            data = self._store.get(self.key(plan, name, steps))
            if data and (found := from_bytes(data)):
                return steps, found
        return 0, None

    def keep(self, plan: ExamplePlan, name: str, steps: int, found: PassFound) -> None:
        """Remember what the first `steps` of a pass found. Raises OutputError where the disk refuses."""
        if self._store is not None:
            self._store.put(self.key(plan, name, steps), to_bytes(found))

    def key(self, plan: ExamplePlan, name: str, steps: int | None = None) -> str:
        """Key of what the first `steps` of a pass find, or all."""
        made_by = dict(self._made_by)
        if shows_field(plan, name):
            made_by["field"] = digest(self._field_made_by)
        return key_of(inputs_of(plan, name, steps), made_by)


NO_MEMORY = PassMemory(None, {})


def to_bytes(found: PassFound) -> bytes:
    """A pass as an npz file without pickles; values that are one number throughout are stored once, and figures that
    are the mean not at all."""
    arrays: dict[str, Any] = {"pixels": found.pixels.astype(np.int64), "iterations": np.array(found.sampled.iterations),
              "stopped": _pairs(found.sampled.stopped), "facts": np.array(list(found.facts)),
              "values": np.array(list(found.facts.values()), dtype=np.float64)}
    for number, half in enumerate(found.sampled.halves):
        arrays |= {f"{name}{number}": _narrow(_once(getattr(half, name))) for name in FIGURES
                   if name == "mean" or getattr(half, name) is not half.mean}
        arrays[f"spp{number}"] = _once(half.spp.astype(np.int64))
        arrays[f"shape{number}"] = np.array(half.mean.shape)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def from_bytes(data: bytes) -> PassFound | None:
    """The pass that `to_bytes` stored; None where the bytes are of another kind."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            halves = tuple(_half(arrays, number) for number in range(len(arrays["iterations"])))
            sampled = Sampled(halves=halves, iterations=tuple(arrays["iterations"].tolist()),
                              stopped=dict(arrays["stopped"].reshape(-1, 2).tolist()))
            facts = dict(zip(arrays["facts"].tolist(), arrays["values"].tolist(), strict=True))
            return PassFound(pixels=arrays["pixels"], sampled=sampled, facts=facts)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None


def _half(arrays: Mapping[str, np.ndarray], number: int) -> Estimate:
    shape = tuple(arrays[f"shape{number}"])
    mean = np.broadcast_to(arrays[f"mean{number}"], shape).astype(np.float64)
    figures = {name: np.broadcast_to(arrays[key], shape).astype(np.float64)
               if (key := f"{name}{number}") in arrays else mean for name in FIGURES[1:]}
    return Estimate(mean=mean, **figures, spp=np.broadcast_to(arrays[f"spp{number}"], shape[:1]).copy())


def _once(values: np.ndarray) -> np.ndarray:
    return values.flat[:1].reshape(()) if values.size and (values == values.flat[0]).all() else values


def _narrow(values: np.ndarray) -> np.ndarray:
    """In single precision where that loses nothing."""
    narrow = values.astype(np.float32)
    return narrow if np.array_equal(narrow, values, equal_nan=True) else values


def _pairs(pairs: Mapping[str, str]) -> np.ndarray:
    return np.array([*pairs.items()], dtype=str).reshape(-1, 2)
