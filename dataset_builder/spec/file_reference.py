"""A file that another file names, and how large files may be."""

import os
from dataclasses import dataclass
from pathlib import Path

MOST_BYTES = 2**31
"""Of a mesh, a buffer, or an image."""


@dataclass(frozen=True, kw_only=True)
class FileReference:
    """A file that a mesh file needs."""

    by: Path
    """The file that names it, the mesh or its material library."""
    key: str
    """Where in `by`."""
    written: str
    """What stands there."""
    name: str
    """Its path relative to the folder of the mesh file."""
    image: bool
    """Whether it is a texture that is read."""


def is_inside(folder: Path, name: str) -> bool:
    """Whether a file lies in a folder or below it, once links and `..` are followed. Raises ValueError for what no file
    can be called."""
    top = os.path.realpath(folder)
    return os.path.realpath(os.path.join(top, name)).startswith(os.path.join(top, ""))


def is_within(folders: tuple[Path, ...], name: str) -> bool:
    """Whether a file, relative to the first of some folders, `is_inside` one of them."""
    return any(is_inside(folder, os.path.join(folders[0], name)) for folder in folders)
