"""What a whole dataset has to do, by arithmetic on its plans."""

from collections.abc import Mapping
from dataclasses import dataclass

from dataset_builder.layers import LIT
from dataset_builder.planning.cost import estimate
from dataset_builder.planning.pass_work import Rates
from dataset_builder.studies.sampled import StudySpec


@dataclass(frozen=True, kw_only=True)
class DatasetWork:
    """Totals of a dataset as its spec stands, whatever its samples."""

    examples: int
    views: int
    tried: int
    """Views that were planned for this estimate."""
    runs: Mapping[str, int]
    """Launches of each pass."""
    pixels: Mapping[str, float]
    """Traced by all launches of each pass."""
    spp: Mapping[str, int]
    """The spec's own, by pass with light."""
    bytes: Mapping[str, float]
    """Stored, by type of the values."""
    error: float
    """Relative standard error of all this, from the views that were planned."""
    fields: float
    """Core-seconds of fields, by the plan's model."""
    rates: Mapping[str, float]
    """What the plan's model says where nothing was measured: seconds per path, launch, view and example."""


def dataset_work(spec: StudySpec) -> DatasetWork:
    """The work of a dataset. Raises PlanError where no view of some split can be planned."""
    rates, own = Rates(), spec.dataset.render.spp
    found = {dtype: estimate(spec.planner(f"storage.dtype={dtype}"), rates=rates) for dtype in ("float32", "float16")}
    cost = found["float32"]
    return DatasetWork(
        examples=cost.examples, views=cost.views, tried=cost.tried, runs=dict(cost.runs), pixels=dict(cost.traced),
        spp={name: own.total(name) for name in LIT},
        bytes={dtype: one.total.bytes for dtype, one in found.items()},
        error=cost.error.seconds / cost.total.seconds, fields=cost.field_cost.seconds,
        rates={"path": 1 / rates.light_paths, "launch": rates.seconds_per_pass, "view": rates.seconds_per_view,
               "example": rates.seconds_per_example})
