"""What is handed out at a time: units grouped by what they are predicted to cost, and what is tried after a failure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.planning.catalogue import ViewUnit
from dataset_builder.planning.cost import Cost, view_cost
from dataset_builder.planning.pass_work import Rates
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.view.visibility import window_share

SECONDS = 4.0
"""That a hand-out is to take at least, so that handing it out costs next to nothing."""

SHARE = 4
"""Hand-outs that every worker gets at least, where there are as many units, so that they end at about the same time."""

TRIES = 3
"""Times that a unit is tried whose process dies; the loss of a machine is no fault of the unit, and does not count."""


@dataclass(frozen=True, kw_only=True)
class HandOut:
    """Units that one process does, one after the other."""

    units: tuple[Any, ...]
    seconds: float = 0.0
    """Predicted, on one core."""
    bytes: float = 0.0
    """Predicted, of the examples as they are stored."""
    tries: int = 0
    """How often its process died."""


def unit_costs(planner: Planner, units: Sequence[ViewUnit]) -> dict[str, Cost]:
    """Cost of one example by split, from the plan of the first unit of it that can be planned."""
    spec, found = planner.loaded.dataset, dict[str, Cost]()
    for unit in units:
        split = unit.view.pair.split
        if split in found:
            continue
        try:
            plan = planner.example(unit.examples[0])
        except PlanError:
            continue
        window = window_share(planner.view(unit.view).arrangement,
                              Pinhole.of(plan.camera, spec.image.width, spec.image.height))
        cost = view_cost(plan, len(unit.lights), len(unit.levels), window, spec.storage.dtype, Rates())
        count = len(unit.lights) * len(unit.levels)
        found[split] = Cost(seconds=cost.seconds / count, bytes=cost.bytes / count)
        if len(found) == len(spec.splits):
            break
    return found


def grouped(units: Sequence[Any], costs: Mapping[str, Cost], workers: int) -> list[HandOut]:
    """Neighbours together until they take `SECONDS`, as long as every worker gets `SHARE` hand-outs; each by itself
    where nothing is known of its cost."""
    each = [HandOut(units=(unit,), seconds=cost.seconds * len(unit.examples), bytes=cost.bytes * len(unit.examples))
            for unit in units for cost in [costs.get(unit.view.pair.split, Cost())]]
    most = min(SECONDS, sum(one.seconds for one in each) / (workers * SHARE))
    found = list[HandOut]()
    for one in each:
        last = found[-1] if found else None
        if last is not None and one.seconds and last.seconds + one.seconds <= most:
            found[-1] = replace(last, units=last.units + one.units, seconds=last.seconds + one.seconds,
                                bytes=last.bytes + one.bytes)
        else:
            found.append(one)
    return found


def after_death(dead: HandOut, reason: str) -> list[HandOut] | Problem:
    """What is tried where a process died: each unit by itself, with more memory, then each of its examples; where
    nothing is left to try, what to say of the unit."""
    each = [replace(dead, units=(unit,), tries=dead.tries + 1, seconds=dead.seconds / len(dead.units),
                    bytes=dead.bytes / len(dead.units)) for unit in dead.units]
    if dead.tries + 1 < TRIES - 1:
        return each
    unit = dead.units[0]
    if dead.tries + 1 < TRIES:
        if not isinstance(unit, ViewUnit):
            return each
        count = len(unit.examples)
        return [replace(each[0], units=(replace(unit, examples=(ref,)),), seconds=dead.seconds / count,
                        bytes=dead.bytes / count) for ref in unit.examples]
    return Problem(where=str(unit), path="", rule=f"{reason}, {TRIES} times",
                   hint="what was finished is kept: ask for smaller images, or add a machine with more memory, and run "
                        "the same command again")


def reserved(tries: int, share: int, largest: int) -> int:
    """Bytes of memory that are reserved for a process: its even share of a machine's, and twice as much each time that
    it died, up to a whole machine's."""
    return min(share * 2**tries, largest)
