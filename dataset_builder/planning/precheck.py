"""Errors of a spec that show before anything is rendered or written."""

from collections.abc import Iterable

from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.contents import SplitContents

PROBES = 3
"""Views per split that are planned; a spec under which all of them fail is refused."""


def probe(planner: Planner) -> None:
    """Read every mesh file, and plan a few views of every split.

    Raises UserError with all that is wrong with mesh files, and the first PlanError where all views of a split fail.
    """
    _read_meshes(planner)
    for split in planner.loaded.dataset.splits:
        refs = [ref for ref in planner.examples if ref.view.pair.split == split.name]
        problems = []
        for ref in refs[::max(1, len(refs) // PROBES)][:PROBES]:
            try:
                planner.example(ref)
                break
            except PlanError as error:
                problems.append(error)
        else:
            raise problems[0]


def _read_meshes(planner: Planner) -> None:
    problems: list[Problem] = []
    for plan in _mesh_objects(planner.contents.values()):
        try:
            asset_of(plan, planner.loaded.path.parent)
        except UserError as error:
            problems += error.problems
    if problems:
        raise PlanError(problems)


def _mesh_objects(splits: Iterable[SplitContents]) -> Iterable[ObjectPlan]:
    """One object of every mesh file."""
    plans = [plan for split in splits
             for plan in (*split.objects, *(piece.object for scene in split.scenes for piece in scene.furniture))]
    return {plan.source: plan for plan in plans if plan.kind == "file"}.values()
