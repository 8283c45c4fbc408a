"""Images that a spec names for lights and for rooms: where, and whether there is such a file."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dataset_builder.digest import sha256_file
from dataset_builder.errors import Problem
from dataset_builder.spec.check import files_like
from dataset_builder.spec.document import Document, items_of, value_at
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.file_reference import MOST_BYTES
from dataset_builder.spec.named_files import key_of
from dataset_builder.spec.problems import dotted, shown

ENVIRONMENT_SUFFIXES = (".exr", ".hdr")
TEXTURE_SUFFIXES = (".exr", ".png")
SURFACE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".exr")
"""Files that an environment, the texture of a lamp, and the texture of a room's surface may be."""


@dataclass(frozen=True, kw_only=True)
class ImageUse:
    """One place in a dataset or room file that names an image."""

    name: str
    """Relative to the folder of the dataset file."""
    suffixes: tuple[str, ...]
    """Those that this use allows."""
    where: str
    """`file:line`."""
    key: str
    """Dotted."""


def image_uses(document: Document) -> tuple[ImageUse, ...]:
    """Every place in a dataset file that names an image, in its order."""
    return tuple(ImageUse(name=name, suffixes=suffixes, where=document.place(path), key=dotted(path))
                 for path, name, suffixes in _named(document.data))


def room_image_uses(document: Document, key: str) -> tuple[ImageUse, ...]:
    """Every place in the room file `key` that names an image."""
    materials = value_at(document.data, "materials")
    named = [(("materials", role, "texture"), name) for role, own in (materials if isinstance(materials, dict) else
             {}).items() if isinstance(name := value_at(own, "texture"), str) and name]
    return tuple(ImageUse(name=key_of(name, key), suffixes=SURFACE_SUFFIXES, where=document.place(path),
                          key=dotted(path)) for path, name in named)


def find_images(uses: Iterable[ImageUse], folder: Path) -> tuple[dict[str, str], list[Problem]]:
    """SHA-256 of every image that is named, by its name from `folder`, that of the dataset file; and what is wrong.

    `rendering.scene.image_check` looks at what is in them.
    """
    digests, problems = dict[str, str](), list[Problem]()
    for use in uses:
        file = folder / use.name
        rule, hint = _image_rule(file, use.name, use.suffixes)
        if not rule and use.name not in digests:
            try:
                digests[use.name] = sha256_file(file, most=MOST_BYTES)
            except OSError as error:
                rule = f"expected a readable image, got: {error.strerror}"
        if rule:
            problems.append(Problem(where=use.where, path=use.key, rule=rule, hint=hint))
    return digests, problems


def _image_rule(file: Path, name: str, suffixes: tuple[str, ...]) -> tuple[str, str]:
    """The rule that a named image breaks, and a hint."""
    if file.suffix.lower() not in suffixes:
        return f"expected a file that ends in one of {' '.join(suffixes)}, got {shown(name)}", "convert it"
    if os.path.isdir(file):
        return f"expected an image, got the folder {shown(name)}", "name a file in it"
    if not os.path.isfile(file):
        return f"expected an image, found none at {shown(name)}", files_like(file)
    return "", ""


def _named(data: Any) -> Iterator[tuple[KeyPath, str, tuple[str, ...]]]:
    """Where plain data of a dataset names an image, its name, and the suffixes that it may have."""
    for part in ("source", "target"):
        if isinstance(name := value_at(value_at(data, part), "environment"), str) and name:
            yield (part, "environment"), name, ENVIRONMENT_SUFFIXES
    target = value_at(data, "target")
    for index, name in items_of(value_at(target, "textures")):
        if isinstance(name, str):
            yield ("target", "textures", index), name, TEXTURE_SUFFIXES
    for index, lamp in items_of(value_at(target, "lights")):
        if isinstance(name := value_at(lamp, "texture"), str) and name:
            yield ("target", "lights", index, "texture"), name, TEXTURE_SUFFIXES
