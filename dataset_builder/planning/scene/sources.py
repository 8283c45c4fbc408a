"""What the objects of a dataset, and its scenes from files, were made from, and under which licences."""

from collections.abc import Iterator, Mapping
from typing import Literal

from dataset_builder.label.scene_plan import ObjectSource
from dataset_builder.planning.scene.contents import SplitContents
from dataset_builder.planning.scene.scene_models import scene_facts
from dataset_builder.planning.scene.things import left_out, targets
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
