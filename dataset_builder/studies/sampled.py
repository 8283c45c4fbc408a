"""The examples of studies: a few of a dataset, planned with other settings but the same content."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from dataset_builder.errors import PlanError, UserError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.plan import Planner
from dataset_builder.seeding import derive_seed
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spread import runs, shares

PLANNERS = 128
"""Planners kept: one per setting, so that neighbouring examples share what they share."""


@dataclass(frozen=True, kw_only=True)
class StudySpec:
    """A dataset spec under study."""

    path: Path
    overrides: tuple[str, ...] = ()
    """What the user changed, before any setting of the study."""

    @property
    def dataset(self) -> DatasetSpec:
        """The spec without any setting of the study."""
        return self.planner().loaded.dataset

    @property
    def mesh_root(self) -> Path:
        """Folder that mesh files are relative to."""
        return self.path.parent

    def planner(self, *settings: str) -> Planner:
        """The planner of the spec with `settings`, overrides as `--set` takes them."""
        return _planner(self.path, (*self.overrides, *settings))

    def plan(self, ref: ExampleRef, *settings: str) -> ExamplePlan:
        """The plan of one example with `settings`; raises SpecError and PlanError as a build does."""
        return self.planner(*settings).example(ref)

    def count(self, wanted: int) -> int:
        """`wanted` examples, or all where the dataset has fewer."""
        return min(wanted, len(self.planner().examples))

    def sample(self, count: int) -> tuple[ExampleRef, ...]:
        """`count` examples that can be planned, spread evenly over the dataset, some of every split where there are
        enough; the same ones every time. Raises PlanError where there is none."""
        planner = self.planner()
        chosen = tuple(found for part in _parts(planner.examples, count)
                       if (found := next(_plannable(planner, part), None)))
        if not chosen:
            raise PlanError("no example of those sampled can be planned; `dataset-builder plan` says why")
        return chosen


@lru_cache(maxsize=PLANNERS)
def _planner(path: Path, overrides: tuple[str, ...]) -> Planner:
    return Planner(load_dataset(path, overrides))


def _parts(refs: Sequence[ExampleRef], count: int) -> list[list[ExampleRef]]:
    """The dataset cut into `count` runs of neighbours, none across two splits; one example is to come of each."""
    by_split: dict[str, list[ExampleRef]] = {}
    for ref in refs:
        by_split.setdefault(ref.view.pair.split, []).append(ref)
    groups = list(by_split.values())[:count]
    return [group[run.start:run.stop]
            for group, share in zip(groups, shares([len(group) for group in groups], count), strict=True)
            for run in runs(len(group), share)]


def _plannable(planner: Planner, refs: Sequence[ExampleRef]) -> Iterator[ExampleRef]:
    for ref in refs:
        try:
            planner.example(ref)
        except PlanError:
            continue
        yield ref


def rerendered(plan: ExamplePlan, **changes: object) -> ExamplePlan:
    """The same plan with other values of `render`, which are not checked again."""
    return plan.model_copy(update={"render": plan.render.model_copy(update=changes)})


def reseeded(plan: ExamplePlan, *path: str | int) -> ExamplePlan:
    """The same plan with other Monte Carlo samples: independent of the plan's own and of every other path's.

    The seed of a spec cannot do that, for it decides the content, too.
    """
    return rerendered(plan, seed=str(derive_seed(int(plan.render.seed), "study", *path)))


def chosen_layers(spec: DatasetSpec, wanted: Sequence[str]) -> dict[str, str]:
    """Those of the layers `wanted` that the dataset holds, with their extents. Raises UserError where it holds none."""
    found = {name: spec.layers[name] for name in wanted if name in spec.layers}
    if not found:
        raise UserError(f"layers: expected some of {', '.join(spec.layers)}, got {', '.join(wanted)}")
    return dict[str, str](found)
