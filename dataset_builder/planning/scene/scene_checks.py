"""What is wrong with the scene files of a spec: all of them are read, and all problems gathered."""

from collections.abc import Iterator, Mapping

from dataset_builder.errors import Problem, UserError
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.scene.contents import ScenePlan, SplitContents, across
from dataset_builder.planning.scene.object_size import scene_size_problem
from dataset_builder.planning.scene.scene_models import SceneFacts, scene_facts
from dataset_builder.planning.scene.things import left_out, slots, targets, unknown_names
from dataset_builder.spec.licences import contradiction
from dataset_builder.spec.resolve import LoadedSpec


def scene_problems(loaded: LoadedSpec, drawn: Mapping[str, SplitContents]) -> list[Problem]:
    """Everything that is wrong with the scene files of a spec, each problem with the line that it is about: what cannot
    be read, names and queries that nothing in a scene fits, lights and cameras that it has not, sizes, licences, and
    splits that share a target."""
    found = dict[str, list[tuple[str, str]]]()
    problems = list[Problem]()
    for split in drawn.values():
        for scene in split.scenes:
            try:
                problems += _problems(loaded, scene)
                chosen = _chosen(loaded, split, scene)
                found.setdefault(split.name, []).extend((plan.name, plan.source_sha256) for plan in chosen)
            except UserError as error:
                problems += [_at(loaded, scene, problem) for problem in error.problems]
    problems += across(drawn, lambda split: found.get(split.name, []), "objects",
                       "give each split scenes of other things, or ask for others")
    return [*dict.fromkeys(problems)]


def _chosen(loaded: LoadedSpec, split: SplitContents, scene: ScenePlan) -> tuple[ObjectPlan, ...]:
    """The targets of a scene that are its own things; where they are not, its slots are looked for."""
    if scene.file is None:
        return ()
    if split.things is not None:
        return targets(loaded, split, scene)
    if scene.file.slot is not None:
        slots(loaded, scene, scene.file.slot)
    return ()


def _problems(loaded: LoadedSpec, scene: ScenePlan) -> Iterator[Problem]:
    if scene.file is None:
        return
    facts = scene_facts(scene.room, loaded.path.parent)
    yield from unknown_names(loaded, scene, facts)
    yield from _missing(loaded, scene, facts)
    if odd := scene_size_problem(facts, scene, loaded):
        yield odd
    gone = left_out(scene, facts)
    own = {f"{thing.name} of {scene.file.path}": thing.licence for thing in facts.things if thing.name not in gone}
    if why := contradiction(loaded.dataset.licence, own):
        yield loaded.problem("", ("licence",), f"expected one that the things of its scenes allow, got "
                             f"{loaded.dataset.licence}: {why}", "change it, or take the thing away with `leave_out`")


def _missing(loaded: LoadedSpec, scene: ScenePlan, facts: SceneFacts) -> Iterator[Problem]:
    """Where a spec asks for lights or cameras of a file that has none."""
    file = scene.file
    if file is None:
        return
    for asked, found, path, what, other in (
            (file.lights.use == "kept", facts.lights, ("file", "lights", "use"), "lights", "use: replaced"),
            (file.cameras == "own", facts.cameras, ("file", "cameras"), "cameras", "cameras: random")):
        if asked and not found:
            said = "; ".join(line for line in facts.said if line.startswith(what.removesuffix("s") + " "))
            yield loaded.problem(scene.key, path, f"expected a scene with {what}, got none in "
                                 f"{scene.room.scene.file.source}" + f"; {said}" * bool(said), f"write `{other}`")


def _at(loaded: LoadedSpec, scene: ScenePlan, problem: Problem) -> Problem:
    """A problem of a scene file as one of the spec's line that names it; one of the spec stays as it is."""
    if problem.where in _places(loaded):
        return problem
    rule = ": ".join(part for part in (problem.where, problem.path, problem.rule) if part)
    return loaded.problem(scene.key, ("file", "path"), rule, problem.hint)


def _places(loaded: LoadedSpec) -> set[str]:
    """Where something is written in the dataset file and in scenes that come from files."""
    return {place for document in loaded.documents.values() for place in (document.name, *document.places.values())}
