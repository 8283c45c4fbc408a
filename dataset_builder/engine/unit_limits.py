"""How long a unit may take before its process counts as hung."""

from dataclasses import dataclass
from math import inf
from typing import Any

from dataset_builder.planning.catalogue import ExampleRef, ViewUnit
from dataset_builder.planning.effects.decisions import FACTOR, REPEATS
from dataset_builder.planning.field_cost import field_seconds
from dataset_builder.planning.pass_work import Rates
from dataset_builder.planning.unit_cost import unit_seconds
from dataset_builder.rendering.field_shelf import FieldTask
from dataset_builder.spec.dataset import DatasetSpec

TIMES = 20
"""A unit may take so many times the seconds that are expected of one core."""

LEAST = 1200.0
"""Seconds that any may take: large files are read, kernels compiled."""


@dataclass(frozen=True, kw_only=True)
class UnitLimits:
    """Seconds that a unit of a build may take: of a view, of the example of a calibration, of a field."""

    spec: DatasetSpec
    fixed: float | None = None
    """For all units, in place of what is expected; 0 for no limit."""

    def __call__(self, unit: Any) -> float:
        """Of one unit."""
        if self.fixed is not None:
            return self.fixed or inf
        return max(TIMES * self._expected(unit), LEAST)

    def _expected(self, unit: Any) -> float:
        match unit:
            case ViewUnit():
                return unit_seconds(self.spec, unit)
            case ExampleRef():
                return (REPEATS + FACTOR) * unit_seconds(self.spec, ViewUnit(view=unit.view, examples=(unit,)))
            case FieldTask():
                return field_seconds(unit.field, Rates())
        return inf
