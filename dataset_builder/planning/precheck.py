"""Errors of a spec that show before anything is rendered or written."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.effects.materials_used import told_of, told_of_scene
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.contents import SplitContents, place_of
from dataset_builder.planning.scene.object_size import size_problem
from dataset_builder.planning.scene.scene_checks import scene_problems
from dataset_builder.planning.scene.scene_models import scene_facts

PROBES = 3
"""Views per split that are planned; a spec under which all of them fail is refused."""


def probe(planner: Planner) -> None:
    """Read every mesh and scene file, and plan a few views of every split.

    Raises UserError with all that is wrong with them, and the first PlanError where all views of a split fail.
    """
    read_meshes(planner)
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


@dataclass(frozen=True, kw_only=True)
class MeshFiles:
    """What was found in all mesh and scene files of a spec."""

    warnings: tuple[str, ...]
    """What is unusual about sizes, one sentence each."""
    told: dict[str, tuple[tuple[str, str], ...]]
    """Pairs of a word and a sentence, of every file: what it contains, and what became of it."""


def read_meshes(planner: Planner) -> MeshFiles:
    """Read every mesh file of the spec, of objects and of furniture, and every scene file.

    Raises PlanError with everything that is wrong with any of them, each problem with the line of the spec that names
    the file: what cannot be read, changes of materials that it does not have, sizes that cannot be meant, and what
    `scene_problems` finds.
    """
    warnings, loaded = list[str](), planner.loaded
    told = _told_of_scenes(planner)
    problems = scene_problems(loaded, planner.contents)
    for plan in _mesh_objects(planner.contents.values()):
        try:
            told[plan.source] = tuple(told_of(asset_of(plan, loaded.path.parent)))
            found = size_problem(plan, loaded)
            if found and found[1]:
                problems.append(found[0])
            elif found:
                warnings.append(str(found[0]))
        except UserError as error:
            place = place_of(loaded, plan)
            problems += [_at(place, problem) for problem in error.problems]
    if problems:
        raise PlanError(dict.fromkeys(problems))
    return MeshFiles(warnings=tuple(dict.fromkeys(warnings)), told=told)


def _told_of_scenes(planner: Planner) -> dict[str, tuple[tuple[str, str], ...]]:
    """What is told of every scene file that can be read; its facts are taken while it is in memory."""
    told, root = dict[str, tuple[tuple[str, str], ...]](), planner.loaded.path.parent
    for scene in (scene for split in planner.contents.values() for scene in split.scenes if scene.file):
        with suppress(UserError):
            scene_facts(scene.room, root)
            told[scene.room.scene.file.source] = told_of_scene(scene.room, root)
    return told


@contextmanager
def meshes_named(planner: Planner) -> Iterator[None]:
    """Where planning meets a mesh file that cannot be read, tell of all of them, each with its line of the spec."""
    try:
        yield
    except PlanError:
        raise
    except UserError:
        read_meshes(planner)
        raise


def _at(place: str, problem: Problem) -> Problem:
    """A problem of a mesh file as one of the spec's line that names it."""
    if not place:
        return problem
    inner = ": ".join(part for part in (problem.where, problem.path, problem.rule) if part)
    return Problem(where=place, path="file", rule=inner, hint=problem.hint)


def _mesh_objects(splits: Iterable[SplitContents]) -> Iterable[ObjectPlan]:
    """One object of every mesh file, and of every way to read it."""
    plans = [plan for split in splits
             for plan in (*split.objects, *(piece.object for scene in split.scenes for piece in scene.furniture))]
    return {(plan.source, plan.scale, plan.up, plan.category, plan.materials): plan for plan in plans
            if plan.kind == "file"}.values()
