"""Things of a scene file by query: which are meant, which are targets, which are taken away, and where they stand."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.scene.assets_of_plan import asset_of, thing_of, world_from_object, yaw_and_rest
from dataset_builder.planning.scene.contents import ScenePlan, SplitContents
from dataset_builder.planning.scene.scene_models import SceneFacts, ThingFacts, scene_facts
from dataset_builder.seeding import rng
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.file_scene import EVERY_SIZE, ThingQuery
from dataset_builder.spec.name_patterns import WILD, fits, unmatched
from dataset_builder.spec.problems import nearest, shown
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.usual_sizes import words_of


def left_out(scene: ScenePlan, facts: SceneFacts) -> frozenset[str]:
    """Names of the things that the spec takes away: a path takes what is below it."""
    patterns = [below for each in (scene.file.leave_out if scene.file else ()) for below in (each, f"{each}/*")]
    return frozenset(thing.name for thing in facts.things if any(fits(thing.name, each) for each in patterns))


def matching(query: ThingQuery, facts: SceneFacts, without: frozenset[str]) -> tuple[ThingFacts, ...]:
    """The things that a query means, in the order of the file: those with faces that are no part of the building,
    unless it gives the whole name."""
    low, high = query.size
    return tuple(thing for thing in facts.things if thing.name not in without and thing.faces
                 and (thing.role == "object" or thing.name == query.name) and fits(thing.name, query.name)
                 and query.category in ("", thing.category) and low <= thing.size <= high)


def target_plan(loaded: LoadedSpec, split: SplitContents, pair: PairRef) -> ObjectPlan:
    """The target of a pair. Raises PlanError where its scene has too few things that the split asks for, UserError
    where the scene cannot be read."""
    if split.things is None:
        return split.objects[pair.object]
    return targets(loaded, split, split.scenes[pair.scene])[pair.object]


def targets(loaded: LoadedSpec, split: SplitContents, scene: ScenePlan) -> tuple[ObjectPlan, ...]:
    """Those things of a scene that are targets of its split, in a seeded order; raises as `target_plan` does."""
    query = split.things or ThingQuery()
    facts = scene_facts(scene.room, loaded.path.parent)
    found = matching(query, facts, left_out(scene, facts))
    if len(found) < split.count:
        number = [each.name for each in loaded.dataset.splits].index(split.name)
        raise PlanError([_too_few(loaded, ("", ("splits", number, "objects", "things")), split.count, query, facts,
                                  scene, len(found))])
    order = rng(loaded.dataset.seed, split.name, "scene", scene.number, "things").permutation(len(found))
    return tuple(_thing_plan(split.name, scene, found[which], len(scene.furniture) + k)
                 for k, which in enumerate(order[:split.count].tolist()))


def _thing_plan(split: str, scene: ScenePlan, thing: ThingFacts, number: int) -> ObjectPlan:
    """A thing as an object, whose numbers begin after those of the scene's furniture."""
    own = yaw_and_rest(np.array(thing.world))[1]
    word = "-".join(words_of(thing.category)) or "object"
    return ObjectPlan(kind="thing", name=f"{split}-scene{scene.number:02d}-{word}-{number:02d}",
                      source=scene.room.scene.file.source, source_sha256=thing.content, category=thing.category,
                      licence=thing.licence, seed="0", params=(), scale=1.0, up="z", scene=scene.room.scene.file,
                      thing=thing.name, linear=tuple(own.ravel().tolist()))


def placed_thing(plan: ObjectPlan, mesh_root: Path, instance: int) -> PlacedObject:
    """A thing as an object, where its scene has it."""
    thing = thing_of(plan, mesh_root)
    yaw, _ = yaw_and_rest(thing.world)
    turned = world_from_object(PlacedObject(object=plan, instance=instance, position=(0.0, 0.0, 0.0), yaw=yaw))
    first = thing.asset.mesh.positions[0]
    there = thing.world[:3, :3] @ first + thing.world[:3, 3]
    x, y, z = (there - turned[:3, :3] @ asset_of(plan, mesh_root).mesh.positions[0]).tolist()
    return PlacedObject(object=plan, instance=instance, position=(x, y, z), yaw=yaw)


@dataclass(frozen=True, kw_only=True)
class Slot:
    """The thing that a target takes the place of."""

    thing: str
    """Its name."""
    middle: tuple[float, float]
    """Of its footprint, metres."""
    base: float
    """Height of its lowest point, metres."""
    yaw: float
    """Degrees."""


def slot_of(loaded: LoadedSpec, split: SplitContents, pair: PairRef) -> Slot | None:
    """The thing that the target of a pair takes the place of; None where the scene names none. Raises PlanError where
    no thing fits."""
    scene = split.scenes[pair.scene]
    if scene.file is None or scene.file.slot is None or split.things is not None:
        return None
    found = slots(loaded, scene, scene.file.slot)
    thing = found[rng(loaded.dataset.seed, *pair.path, "slot").integers(len(found))]
    placed = placed_thing(_thing_plan(split.name, scene, thing, 0), loaded.path.parent, 1)
    return Slot(thing=thing.name, middle=placed.position[:2], base=placed.position[2], yaw=placed.yaw)


def slots(loaded: LoadedSpec, scene: ScenePlan, query: ThingQuery) -> tuple[ThingFacts, ...]:
    """The things of a scene that a target may take the place of. Raises PlanError where there is none."""
    facts = scene_facts(scene.room, loaded.path.parent)
    found = matching(query, facts, left_out(scene, facts))
    if not found:
        raise PlanError([_too_few(loaded, (scene.key, ("file", "slot")), 1, query, facts, scene, 0)])
    return found


def _too_few(loaded: LoadedSpec, at: tuple[str, KeyPath], wanted: int, query: ThingQuery, facts: SceneFacts,
             scene: ScenePlan, got: int) -> Problem:
    said = [f"{name} {shown(value)}" for name, value in (("name", query.name), ("category", query.category),
                                                        ("size", query.size))
            if value != ThingQuery.model_fields[name].default]
    what = f"{wanted} thing{'s' * (wanted > 1)}" + (f" with {', '.join(said)}" if said else "")
    return loaded.problem(*at, f"expected {what} in {scene.room.scene.file.source}, got {got} of "
                          f"{len(facts.things)}", _hint(query, facts, left_out(scene, facts)))


def _hint(query: ThingQuery, facts: SceneFacts, without: frozenset[str]) -> str:
    """What the writer of a query that too little fits may have meant."""
    names = [thing.name for thing in facts.things]
    named = [thing for thing in facts.things if fits(thing.name, query.name)]
    if not named:
        word = query.name.strip(WILD)
        if told := next((said for said in facts.said if word and word in said), ""):
            return told
        return nearest(word, names)
    usable = [thing for thing in named if thing.role == "object" and thing.faces and thing.name not in without]
    if not usable:
        return _unusable(named[0], without)
    kinds = sorted({thing.category for thing in usable})
    if query.category and query.category not in kinds:
        return nearest(query.category, kinds, "category")
    sizes = [thing.size for thing in usable]
    if query.size == EVERY_SIZE and min(sizes) > EVERY_SIZE[1]:
        return f"each is longer than {EVERY_SIZE[1]:g} m, from {min(sizes):.3g} m on: correct its units, or `scale`"
    if query.size != EVERY_SIZE:
        return f"the longest sides of those with that name are {min(sizes):.3g} to {max(sizes):.3g} m"
    return "lower the count, or ask for more with *"


def _unusable(thing: ThingFacts, without: frozenset[str]) -> str:
    if thing.name in without:
        return f"`leave_out` takes {thing.name} away"
    if not thing.faces:
        return f"{thing.name} has no faces"
    return (f"{thing.name} is part of the {thing.role}: give its whole name if it is meant, or say under `parts` that "
            "it is an object")


def _groups(names: Sequence[str]) -> dict[str, None]:
    """Every path above those of some things, once."""
    return {name[:end]: None for name in names for end, character in enumerate(name) if character == "/" and end}


def unknown_names(loaded: LoadedSpec, scene: ScenePlan, facts: SceneFacts) -> Iterator[Problem]:
    """A problem for every pattern of a scene spec that names nothing in its file."""
    if scene.file is None:
        return
    things, lights = [thing.name for thing in facts.things], [light.name for light in facts.lights]
    # What a reader parts into floor, walls and ceiling has been named as a whole
    whole = [*things, *(name.rpartition("#")[0] for name in things if "#" in name)]
    named: list[tuple[KeyPath, str, Sequence[str], str]] = [
        *((("leave_out", k), pattern, [*things, *_groups(things)], "thing")
          for k, pattern in enumerate(scene.file.leave_out)),
        *((("parts", part, k), pattern, whole, "thing") for part, patterns in scene.file.parts.items()
          for k, pattern in enumerate(patterns)),
        *((("lights", "dim", pattern), pattern, lights, "light") for pattern in scene.file.lights.dim)]
    for path, pattern, known, what in named:
        if unmatched([pattern], known):
            yield loaded.problem(scene.key, ("file", *path), f"expected the name of a {what} in "
                                 f"{scene.room.scene.file.source}, got {shown(pattern)}",
                                 nearest(pattern.strip(WILD), known, what) or f"it has no {what}s")
