"""What the objects of a dataset, and its scenes from files, were made from, under which licences, and in which splits.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Literal

from dataset_builder.label.scene_plan import ObjectSource
from dataset_builder.label.shared_content import SharedContent
from dataset_builder.planning.scene.contents import SplitContents, scene_digest, shape_digest
from dataset_builder.planning.scene.scene_models import scene_facts
from dataset_builder.planning.scene.things import left_out, targets
from dataset_builder.spec.dataset import Shareable
from dataset_builder.spec.resolve import LoadedSpec

Part = tuple[Literal["procedural", "file", "thing"], str, str]
"""Kind, source and licence."""


def object_sources(loaded: LoadedSpec, drawn: Mapping[str, SplitContents]) -> tuple[ObjectSource, ...]:
    """What all objects, pieces of furniture and scenes from files were made from: mesh files first, then families, then
    scene files, by name; one of each licence that something of it has. Raises UserError where a scene cannot be read.
    """
    names: dict[Part, list[str]] = {}
    for split in drawn.values():
        for part, name in (*_objects(split), *_things(loaded, split)):
            names.setdefault(part, []).extend(name)
    return tuple(ObjectSource(kind=kind, source=source, licence=licence, objects=tuple(own))
                 for (kind, source, licence), own in sorted(names.items()))


def _objects(split: SplitContents) -> Iterator[tuple[Part, list[str]]]:
    for plan in (*split.objects, *(piece.object for scene in split.scenes for piece in scene.furniture)):
        yield (plan.kind, plan.source, plan.licence), [plan.name]


def _things(loaded: LoadedSpec, split: SplitContents) -> Iterator[tuple[Part, list[str]]]:
    """Every licence in a scene from a file, with the targets that are under it."""
    for scene in split.scenes:
        if scene.file is None:
            continue
        facts = scene_facts(scene.room, loaded.path.parent)
        gone = left_out(scene, facts)
        chosen = targets(loaded, split, scene) if split.things else ()
        for licence in dict.fromkeys([scene.file.licence, *(thing.licence for thing in facts.things
                                                            if thing.name not in gone)]):
            yield ("thing", scene.file.path, licence), [plan.name for plan in chosen if plan.licence == licence]


def shared_contents(loaded: LoadedSpec, drawn: Mapping[str, SplitContents]) -> tuple[SharedContent, ...]:
    """What every two splits share, where one of them allows it. Raises UserError where a scene cannot be read."""
    kinds: tuple[Shareable, ...] = ("objects", "scenes")
    found = list[SharedContent]()
    for what in kinds:
        if not any(what in split.allow_shared for split in drawn.values()):
            continue
        has = {name: _digests(loaded, split, what) for name, split in drawn.items()}
        found += [SharedContent(what=what, splits=(one, two), count=len(has[one] & has[two]),
                                of=(len(has[one]), len(has[two])))
                  for one, two in combinations(has, 2) if has[one] & has[two]]
    return tuple(found)


def _digests(loaded: LoadedSpec, split: SplitContents, what: Shareable) -> set[str]:
    if what == "scenes":
        return {scene_digest(scene) for scene in split.scenes}
    if split.things is None:
        return {shape_digest(plan) for plan in split.objects}
    return {plan.source_sha256 for scene in split.scenes for plan in targets(loaded, split, scene)}
