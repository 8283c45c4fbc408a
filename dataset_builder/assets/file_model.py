"""What a reader takes out of a mesh file, and what it says it did not take: the same for every format."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import NoReturn

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.errors import Problem, UserError

GREY = 0.6
"""Albedo of what has neither material nor colours."""
NO_MATERIAL = "no material"
"""Name of its material, by which specs may change it."""
ROUGHNESS = 0.8
"""Of a surface whose file says nothing about it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FilePart:
    """One primitive, group or prim with one material, moved to where the file's transforms put it."""

    name: str
    """What messages call it: `mesh 2 'seat', primitive 0`."""
    positions: np.ndarray
    """(V, 3) float64 in file units and axes."""
    faces: np.ndarray
    """(F, 3) integers into `positions`, counter-clockwise from outside, mirroring transforms already undone."""
    material: int = -1
    """Index into the model's materials; -1 for none, which is a grey of `GREY`, or white under colours."""
    uvs: Mapping[int, np.ndarray] = field(default_factory=lambda: MappingProxyType({}))
    """(F, 3, 2) by number of the set; (0, 0) is the lower left corner of an image."""
    colors: np.ndarray | None = None
    """(F, 3, 4) linear Rec.709 and coverage, in [0, 1]."""
    group: str = ""
    """Object of an .obj file that it belongs to, or its group where the file has no objects."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FileMaterial:
    """A material, and how its texture lies on the parts."""

    material: Material
    uv_set: int = 0
    """Which of a part's sets all of its maps use."""
    uv_transform: np.ndarray | None = None
    """(2, 3) affine map that texture coordinates take first, in the convention of `FilePart.uvs`."""
    left_out: tuple[str, ...] = ()
    """What the file says of it and is not honoured, in words; the plan and the label print it after its name."""
    content: str = ""
    """Digest over what it is made of, bytes of images included; empty where the reader makes none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FileModel:
    """A whole file."""

    parts: tuple[FilePart, ...]
    """In the order of the file; each with at least one face."""
    materials: tuple[FileMaterial, ...]
    contains: str
    """What the file holds and what was taken of it, for people: `2 meshes, 3 primitives, 36 triangles, 2 materials`."""
    left_out: tuple[str, ...] = ()
    """What it holds besides and is not honoured, in words (cameras, animations, points), and then what was decided
    where the file leaves a choice: `morph targets at their stated weights`."""
    wound: bool = False
    """Whether faces are known to look to where they are seen from, into a room too: closed pieces are not turned."""


def refuse(path: Path, rule: str, hint: str = "", *, at: str = "") -> NoReturn:
    """Raise UserError about a file; `at`: where in it, such as `line 12` or `materials[2]`."""
    raise UserError([Problem(where=str(path), path=at, rule=rule, hint=hint)])


def unique(name: str, taken: set[str]) -> str:
    """The name, or with a number if it is among those `taken`, which it joins."""
    number, made = 1, name
    while made in taken:
        number += 1
        made = f"{name}_{number}"
    taken.add(made)
    return made


def counted(number: int, one: str, many: str = "") -> str:
    """A number and what it counts.

    >>> counted(1, "mesh", "meshes"), counted(0, "image"), counted(1234, "triangle")
    ('1 mesh', '0 images', '1,234 triangles')
    """
    return f"{number:,} {one if number == 1 else many or one + 's'}"


def of_each(kind: str, names: Sequence[str], what: str, *, most: int = 3) -> str:
    """What is told of one thing of a kind, or alike of several.

    >>> of_each("light", ["a"], "dark"), of_each("light", ["a", "b", "c", "d"], "dark")
    ('light a: dark', '4 lights (a, b, c and 1 more): dark')
    """
    if len(names) == 1:
        return f"{kind} {names[0]}: {what}"
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{len(names):,} {kind}s ({', '.join(names[:most])}{more}): {what}"
