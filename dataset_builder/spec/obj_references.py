"""The files that an .obj names: material libraries and their maps."""

import os
import re
from collections.abc import Iterator
from pathlib import Path

from dataset_builder.spec.file_reference import FileReference

MTL_MAPS = ("map_", "bump", "norm")
MTL_OPTION = re.compile(r"-(?:(?:mm|o|s|t)(?:\s+[-+]?[\d.]+(?:e[-+]?\d+)?(?=\s)){1,3}|[a-z]+\s+\S+)\s+", re.IGNORECASE)
"""An option before the file name of a texture map: up to three numbers, or one value."""


def obj_references(path: Path) -> Iterator[FileReference]:
    """Libraries lie relative to the .obj, their maps relative to the library."""
    libraries = [library for key, library in _statements(path) if key.lower() == "mtllib"]
    for library in dict.fromkeys(libraries):
        yield FileReference(by=path, key="mtllib", written=library, name=library, image=False)
        # A library that is missing is reported as such by who reads it
        if os.path.isfile(file := path.parent / library):
            for key, written in dict.fromkeys(_statements(file)):
                if key.lower().startswith(MTL_MAPS):
                    yield FileReference(by=file, key=key, written=written, image=key.lower() == "map_kd",
                                        name=str(Path(library).parent / _map_name(written)))


def _statements(path: Path) -> Iterator[tuple[str, str]]:
    """Keyword and arguments of every line of a text file that has both."""
    with path.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            words = line.strip().split(maxsplit=1)
            if len(words) == 2:
                yield words[0], words[1]


def _map_name(arguments: str) -> str:
    """The file name, which options may precede."""
    while option := MTL_OPTION.match(arguments):
        arguments = arguments[option.end():]
    return arguments
