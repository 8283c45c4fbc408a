"""What the fields of a dataset will cost to make: by arithmetic on plans."""

from collections.abc import Callable
from dataclasses import dataclass

from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.field_needs import field_needs
from dataset_builder.planning.pass_work import Rates
from dataset_builder.planning.plan import Planner

Known = Callable[[ObjectPlan, FieldPlan], bool]
"""Whether a field was made already."""


@dataclass(frozen=True, kw_only=True)
class FieldCost:
    """Of the fields of a dataset."""

    count: int = 0
    """Fields in all."""
    known: int = 0
    """Those that were made already."""
    images: int = 0
    """To be rendered for the others."""
    seconds: float = 0.0
    """That the others take, one by one on each core."""
    bytes: float = 0.0
    """Of the others."""


def field_seconds(plan: FieldPlan, rates: Rates) -> float:
    """Seconds of one core for a field: its images, then the fit to them."""
    images = (plan.views + plan.held_out) * (rates.seconds_per_image + plan.size**2 * plan.spp / rates.image_paths)
    return images + rates.seconds_per_field + plan.steps * (
        rates.seconds_per_step + plan.resolution**3 * rates.seconds_per_cell)


def field_cost(planner: Planner, known: Known, rates: Rates, cores: int) -> FieldCost:
    """Cost of all fields that examples of a dataset need; a core makes one at a time."""
    needs = field_needs(planner, planner.examples).values()
    distinct = dict.fromkeys((need.object, need.field) for each in needs for need in each)
    missing = [plan for target, plan in distinct if not known(target, plan)]
    seconds = [field_seconds(plan, rates) for plan in missing]
    return FieldCost(count=len(distinct), known=len(distinct) - len(missing),
                     images=sum(plan.views + plan.held_out for plan in missing),
                     seconds=max(sum(seconds) / cores, max(seconds, default=0.0)),
                     bytes=sum(rates.bytes_per_cell * plan.resolution**3 for plan in missing))
