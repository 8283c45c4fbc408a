"""Model files in folders that nobody prepared, and what each is called."""

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.mesh_source import FIELD_SUFFIX, MESH_SUFFIXES, OTHER_FORMATS, companions

MODELS = tuple(suffix for suffix in MESH_SUFFIXES if suffix != FIELD_SUFFIX)
"""Suffixes of models; captures come with a spec of their own."""
NAMELESS = ("raw_model", "normalized_model", "model", "models", "mesh", "meshes", "scene", "textured", "object", "obj",
            "gltf", "glb", "untitled", "untitled document", "default", "source", "export", "visual", "lod0")
"""Names that say nothing: the folder's is taken instead."""
COPIES = {"normalized_model": "raw_model", "raw_model_tri": "raw_model"}
"""Names of files that hold the model of another file beside them, in a folder of 3D-FUTURE."""


@dataclass(frozen=True, kw_only=True)
class FoundModel:
    """One model file."""

    path: Path
    root: Path
    """The folder that was asked for; the file's own where a file was."""

    @property
    def folders(self) -> list[Path]:
        """From the folder that it lies in up to the root."""
        above = [self.path.parent, *self.path.parent.parents]
        return above[:above.index(self.root) + 1]

    @property
    def title(self) -> str:
        """What it is called: by its file, or by the nearest folder with a name that says something."""
        names = (self.path.stem, *(folder.name for folder in self.folders))
        return next((name for name in names if name and name.lower() not in NAMELESS), self.path.stem)


@dataclass(frozen=True, kw_only=True)
class PassedOver:
    """A file that no object is made from, and why."""

    path: Path
    reason: str


def find_models(paths: Sequence[Path]) -> tuple[list[FoundModel], list[PassedOver]]:
    """The model files among `paths` and in folders below them, each once, in order of path; and files that look like
    models and are none: of formats that are not read, parts of other models, and copies.

    Links to folders and hidden files are passed over. Raises UserError for every path that is not there, and where
    there is no model at all.
    """
    if missing := [path for path in paths if not path.exists()]:
        raise UserError(Problem(where=str(path), path="", rule="expected a file or a folder, found none")
                        for path in missing)
    found, left = dict[Path, FoundModel](), list[PassedOver]()
    for path, root in _files(paths):
        suffix = path.suffix.lower()
        if suffix in (*OTHER_FORMATS, *MODELS) and not str(path).isprintable():
            left.append(PassedOver(path=path, reason="its path holds control characters or bytes that are not UTF-8: "
                                                     "rename it"))
        elif suffix in OTHER_FORMATS:
            called, program = OTHER_FORMATS[suffix]
            left.append(PassedOver(path=path, reason=f"{called} is not read: export glTF from {program}"))
        elif suffix in MODELS:
            found.setdefault(path, FoundModel(path=path, root=root))
    for part in [part for path in found for part in _parts(path) if part != path]:
        found.pop(part, None)
    for path in list(found):
        whole = path.with_name(COPIES.get(path.stem, path.stem) + path.suffix)
        if whole != path and whole in found:
            del found[path]
            left.append(PassedOver(path=path, reason=f"a copy of {whole.name} beside it"))
    if not found:
        shown = ", ".join(map(str, paths))
        rule = f"expected model files ({' '.join(MODELS)}), found none in {shown}"
        raise UserError([*(Problem(where=str(one.path), path="", rule=one.reason) for one in left),
                         Problem(where="", path="", rule=rule)])
    return list(found.values()), left


def _files(paths: Iterable[Path]) -> Iterator[tuple[Path, Path]]:
    """Every regular file with the folder that it was asked for by."""
    for path in map(Path.absolute, paths):
        if path.is_file():
            yield path, path.parent
            continue
        for folder, below, names in os.walk(path):
            below[:] = sorted(name for name in below if not name.startswith("."))
            for name in sorted(names):
                if not name.startswith(".") and (Path(folder) / name).is_file():
                    yield Path(folder) / name, path


def _parts(path: Path) -> list[Path]:
    """Files that a model names; none where it cannot be understood, which is told when it is read."""
    try:
        return [Path(os.path.normpath(path.parent / name)) for name in companions(path)]
    except (OSError, ValueError):
        return []


def file_names(titles: Iterable[str]) -> list[str]:
    """File names of titles, in order: of letters, digits, - and _, and no two the same, whatever the file system makes
    of capitals.

    >>> file_names(["Blue chair (2)", "blue chair/2", "\u692f\u5b50"])
    ['Blue_chair_2', 'blue_chair_2_2', '\u692f\u5b50']
    """
    taken, names = set[str](), list[str]()
    for title in titles:
        plain = re.sub(r"[^\w-]+", "_", title).strip("_-")[:80] or "model"
        name, number = plain, 1
        while name.casefold() in taken:
            number += 1
            name = f"{plain}_{number}"
        taken.add(name.casefold())
        names.append(name)
    return names
