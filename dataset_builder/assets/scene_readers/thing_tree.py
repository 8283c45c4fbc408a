"""A tree of nodes -> which of them are one thing each: what a person would call an object.

From the top, the first node is a thing that
1. a pattern of the spec's `parts` names: whatever hangs below it belongs to it,
2. is called after one kind of thing (`Chair_01`, not `Chairs` or `bedroom`),
3. has a mesh, or is a group that does not hold the whole scene and is not called after a place; below it at most one
   name says what it is, and the pieces of a group touch.
What has a mesh and is none of these (a room whose furniture hangs below it) is a thing without what is below.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.assets.scene_readers.roles import WORDS
from dataset_builder.spec.name_patterns import fits
from dataset_builder.spec.usual_sizes import category_of, usual_of, words_of

PLACES = frozenset((
    "room", "bedroom", "livingroom", "bathroom", "kitchen", "hall", "hallway", "corridor", "office", "studio", "garage",
    "attic", "basement", "cellar", "house", "home", "flat", "apartment", "building", "storey", "story", "level",
    "scene", "interior", "exterior", "environment", "world", "root", "stage", "furniture", "props"))
"""Words for what holds things."""
BUILDING = frozenset((*WORDS, "stair", "staircase"))
"""Words for parts of a building."""
TOUCHING = 0.02
"""Share of a group's diagonal that its pieces may stand apart."""


@dataclass(frozen=True, kw_only=True)
class TreeNode:
    """A node of a scene, whatever the format."""

    path: str
    """Unique in the scene."""
    name: str
    """The last part of its path, as the file has it."""
    parent: int
    """-1 for none."""
    drawn: bool
    """Whether it has a mesh of its own that is there."""


def is_place(name: str) -> bool:
    """Whether a name means a room or something else that holds things.

    >>> is_place("LivingRoom_2"), is_place("bedside table")
    (True, False)
    """
    return bool(PLACES.intersection(words_of(name)))


def names_building(name: str) -> bool:
    """Whether a name has a word for a part of a building.

    >>> names_building("Walls.001"), names_building("wallpaper")
    (True, False)
    """
    return any(word in BUILDING or word.removesuffix("s") in BUILDING for word in words_of(name))


def is_kind(name: str) -> bool:
    """Whether a name means one thing of a known kind.

    >>> is_kind("Chair_01"), is_kind("Chairs"), is_kind("bed room")
    (True, False, False)
    """
    return usual_of(name) is not None and not is_place(name) and not _is_plural(name)


def is_one_kind(name: str) -> bool:
    """Whether a node of this name is one thing, whatever hangs below it: a `Chair`, no part of a building.

    >>> is_one_kind("Chair_01"), is_one_kind("Door")
    (True, False)
    """
    return is_kind(name) and not names_building(name)


def category_in(*paths: str) -> str:
    """The kind of thing that the last part of a path tells that tells of one and is no place, of the first path that
    has such a part; `object` where none does.

    >>> category_in("Room/Chair_01/Object_4"), category_in("Bed room/Object_4"), category_in("a/b", "a/stool")
    ('chair', 'object', 'stool')
    """
    return category_of(name for path in paths for name in reversed(path.split("/")) if not is_place(name))


def _is_plural(name: str) -> bool:
    last = next((word for word in reversed(words_of(name)) if usual_of(word)), "")
    return last.endswith("s") and usual_of(last.removesuffix("s")) is not None


def thing_nodes(nodes: Sequence[TreeNode], order: Sequence[int], patterns: Sequence[str],
                box_of: Callable[[int], np.ndarray]) -> dict[int, list[int]]:
    """The nodes of the meshes of each thing, by the thing's node, in the order of the file.

    order: all nodes, parents first. patterns: names of things that the spec gives. box_of: (2, 3) corners of the mesh
    of a node, in the scene.
    """
    speaking, meshes = _below(nodes, order)
    owner = np.full(len(nodes), -1)
    for number in order:
        parent = nodes[number].parent
        above = int(owner[parent]) if parent >= 0 else -1
        owner[number] = number if _is_named(nodes, number, above, patterns) else above
        if owner[number] < 0 and _is_one(nodes, number, speaking[number], meshes, box_of):
            owner[number] = number
    found: dict[int, list[int]] = {}
    for number, node in enumerate(nodes):
        if node.drawn:
            found.setdefault(int(owner[number]) if owner[number] >= 0 else number, []).append(number)
    return found


def _below(nodes: Sequence[TreeNode], order: Sequence[int]) -> tuple[np.ndarray, list[list[int]]]:
    """How many names below each node say what they are, and the nodes with meshes at and below each."""
    speaking = np.zeros(len(nodes), np.int64)
    meshes: list[list[int]] = [[number] if node.drawn else [] for number, node in enumerate(nodes)]
    for number in reversed(order):
        parent, name = nodes[number].parent, nodes[number].name
        if parent >= 0 and meshes[number]:
            says = usual_of(name) is not None or names_building(name) or is_place(name)
            speaking[parent] += speaking[number] + says
            meshes[parent] += meshes[number]
    return speaking, meshes


def _is_named(nodes: Sequence[TreeNode], number: int, above: int, patterns: Sequence[str]) -> bool:
    """Whether a pattern names the node, and not the thing above it, too."""
    return any(fits(nodes[number].path, pattern) and not (above >= 0 and fits(nodes[above].path, pattern))
               for pattern in patterns)


def _is_one(nodes: Sequence[TreeNode], number: int, speaking: int, meshes: list[list[int]],
            box_of: Callable[[int], np.ndarray]) -> bool:
    node, pieces = nodes[number], meshes[number]
    if not pieces:
        return False
    if is_one_kind(node.name):
        return True
    if speaking > 1 or (speaking and (is_place(node.name) or names_building(node.name))):
        return False
    if node.drawn:
        return True
    whole = len(pieces) > 1 and len(pieces) == sum(each.drawn for each in nodes)
    return not whole and not is_place(node.name) and _hang_together([box_of(piece) for piece in pieces])


def _hang_together(boxes: list[np.ndarray]) -> bool:
    """Whether (2, 3) boxes touch, one by way of the other."""
    low, high = (np.stack([box[end] for box in boxes]) for end in (0, 1))
    reach = TOUCHING * float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
    joined = np.zeros(len(boxes), bool)
    waiting = [0]
    joined[0] = True
    while waiting:
        at = waiting.pop()
        near = ~joined & (low <= high[at] + reach).all(axis=1) & (high >= low[at] - reach).all(axis=1)
        joined |= near
        waiting += np.flatnonzero(near).tolist()
    return bool(joined.all())
