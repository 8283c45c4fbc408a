"""What things are in a building: floor, walls, ceiling, or objects; for the readers of all formats.

First what the spec's `parts` says, then words in the last part of a name (or in the category), then shapes: see
`shape_roles`. What none of these tells is an object.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from dataset_builder.assets.file_model import of_each
from dataset_builder.assets.scene_model import Role, SceneThing
from dataset_builder.assets.scene_readers.parted_building import parted
from dataset_builder.assets.scene_readers.shape_roles import boxes_of, encloses, slab_role
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.spec.name_patterns import fits
from dataset_builder.spec.usual_sizes import usual_of, words_of

WORDS: dict[str, Role] = {
    **dict.fromkeys(("floor", "flooring", "floorboard", "ground", "slab", "parquet"), "floor"),
    **dict.fromkeys(("wall", "window", "windowsill", "door", "doorway", "baseboard", "skirting", "column", "pillar",
                     "facade", "partition"), "walls"),
    **dict.fromkeys(("ceiling", "roof", "cornice", "beam", "rafter"), "ceiling")}
"""Words for parts of a building. Windows and doors go with the walls that hold them, curtains do not."""
HANGING = frozenset((
    "fan", "vent", "socket", "switch", "outlet", "mat", "handle", "knob", "art", "decor", "decoration", "sign",
    "sticker", "decal", "radiator", "heater", "hook", "rack", "mount", "holder", "lighting"))
"""Words for what hangs on a wall or lies on a floor, beside the kinds of usual things."""


def role_of(text: str) -> Role | None:
    """The part of a building that a name means; None where it says nothing, or means furniture.

    >>> role_of("WallInner"), role_of("Ceilings_02"), role_of("floor lamp"), role_of("Door_1"), role_of("Chair")
    ('walls', 'ceiling', None, 'walls', None)
    """
    if says_object(text):
        return None
    words = [word if word in WORDS else word.removesuffix("s") for word in words_of(text)]
    return next((WORDS[word] for word in reversed(words) if word in WORDS), None)


def says_object(text: str) -> bool:
    """Whether a name means a piece of furniture or the like: one word for it is enough.

    >>> says_object("cabinet_door"), says_object("Door_1"), says_object("Object_4"), says_object("wall_art")
    (True, False, False, True)
    """
    kinds = [usual_of(text), *map(usual_of, words_of(text))]
    return any(kind is not None and kind.name != "door" for kind in kinds) or bool(HANGING.intersection(words_of(text)))


def is_building(whole: str, pieces: Iterable[str]) -> bool:
    """Whether pieces of something name different parts of a building, and it is no piece of furniture.

    >>> is_building("House", ("Floor", "WallNorth", "Mesh")), is_building("House", ("Wall_1", "Door"))
    (True, False)
    >>> is_building("Dollhouse", ("Floor", "WallNorth"))
    False
    """
    return not says_object(whole) and len({role for piece in pieces if (role := role_of(piece)) is not None}) > 1


def classified(things: Sequence[SceneThing], source: SceneSource) -> tuple[tuple[SceneThing, ...], tuple[str, ...]]:
    """The things with their roles, a building of one mesh parted into `NAME#floor`, `#walls` and `#ceiling`, and what
    was decided, in words. Roles of `things` other than `object` are kept unless the spec says otherwise."""
    named = [_by_name(thing, source) for thing in things]
    made = [thing for thing, _ in named]
    boxes = boxes_of(things)
    told = np.array([known for _, known in named], dtype=bool)
    shaped = dict[Role, list[str]]()
    for number in np.flatnonzero(~told).tolist():
        if (role := slab_role(number, boxes)) is not None:
            made[number], told[number] = replace(made[number], role=role), True
            shaped.setdefault(role, []).append(made[number].name)
    found: list[SceneThing] = []
    decided = [of_each("thing", names, f"{role} by shape and place") for role, names in shaped.items()]
    objects = np.array([thing.role == "object" for thing in made], dtype=bool)
    each = np.arange(len(made))
    for number, thing in enumerate(made):
        if told[number] or not encloses(thing, boxes[objects & (each != number)]):
            found.append(thing)
            continue
        parts = parted(thing)
        found += [replace(part, role=said_role(part.name, source) or part.role) for part in parts]
        decided.append(f"{thing.name} is the building in one mesh: parted into "
                       f"{', '.join(part.name.rpartition('#')[2] for part in parts)} by how its faces lie")
    return tuple(map(_called, found)), tuple(decided)


def _called(thing: SceneThing) -> SceneThing:
    """A part of the building without a category is called after its role."""
    if thing.role == "object" or thing.category not in ("", "object"):
        return thing
    return replace(thing, category=thing.role.removesuffix("s"))


def _by_name(thing: SceneThing, source: SceneSource) -> tuple[SceneThing, bool]:
    """The thing with the role that the spec, its reader, or its name tells, and whether one of them did."""
    said = said_role(thing.name, source)
    if said is not None:
        return replace(thing, role=said), True
    if thing.role != "object":
        return thing, True
    for text in (thing.name.rpartition("/")[2], thing.category):
        if says_object(text):
            return thing, True
        if (role := role_of(text)) is not None:
            return replace(thing, role=role), True
    return thing, False


def said_role(name: str, source: SceneSource) -> Role | None:
    """What the spec says of a name, the last pattern that fits; None where it says nothing."""
    said = [part.part for part in source.parts if any(fits(name, pattern) for pattern in part.patterns)]
    return said[-1] if said else None
