"""Files with poses of cameras: which a name in a dataset file means, and whether they are there."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dataset_builder.digest import sha256_file
from dataset_builder.errors import Problem
from dataset_builder.spec.check import files_like
from dataset_builder.spec.document import Document, items_of, value_at
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.problems import shown

TRANSFORMS = ("transforms.json", "transforms_train.json")
"""What nerfstudio and NeRF call their poses."""
MODEL_FOLDERS = ("sparse/0", "sparse", "colmap/sparse/0", ".")
"""Where in a folder a model of COLMAP may be."""
MOST_BYTES = 1 << 28
"""Of a file with poses."""


def transforms_file(folder: Path) -> Path | None:
    """The file with the poses of NeRF, or None."""
    return next((folder / name for name in TRANSFORMS if (folder / name).is_file()), None)


def model_folder(folder: Path) -> Path | None:
    """The folder with a sparse model of COLMAP, or None."""
    places = (folder / name for name in MODEL_FOLDERS)
    return next((place for place in places if any((place / f"cameras.{kind}").is_file() for kind in ("bin", "txt"))),
                None)


def pose_files(path: Path) -> tuple[Path, ...]:
    """The files that hold the poses of `path`, a .json file or a folder; none where it is neither."""
    if path.suffix.lower() == ".json":
        return (path,) if path.is_file() else ()
    if found := transforms_file(path):
        return (found,)
    if (model := model_folder(path)) is None:
        return ()
    kind = "bin" if (model / "cameras.bin").is_file() else "txt"
    return tuple(model / f"{name}.{kind}" for name in ("cameras", "images"))


def find_poses(document: Document, folder: Path) -> tuple[dict[str, str], list[Problem]]:
    """SHA-256 of every file with poses that a dataset file in `folder` names, by its path relative to that folder; and
    what is wrong."""
    digests, problems = dict[str, str](), list[Problem]()
    for path, name in _named(document.data):
        files = pose_files(folder / name)
        rule, hint = "", ""
        if not files:
            rule = (f"expected a .json file, or a folder with {TRANSFORMS[0]} or COLMAP's cameras and images, found "
                    f"none at {shown(name)}")
            hint = "" if os.path.isdir(folder / name) else files_like(folder / name)
        for file in files:
            try:
                digests[os.path.normpath(os.path.relpath(file, folder) if not os.path.isabs(name) else file)] = \
                    sha256_file(file, most=MOST_BYTES)
            except OSError as error:
                rule = f"expected a readable {file.name}, got: {error.strerror}"
        if rule:
            problems.append(document.problem((*path, "camera", "path", "file"), rule, hint))
    return digests, problems


def _named(data: Any) -> Iterator[tuple[KeyPath, str]]:
    """Where plain data of a dataset has a camera with poses from a file, and the name of that."""
    places: list[tuple[KeyPath, Any]] = [((), data)]
    places += [(("splits", number), split) for number, split in items_of(value_at(data, "splits"))]
    for place, holder in places:
        path = value_at(value_at(holder, "camera"), "path")
        if value_at(path, "kind") == "poses" and isinstance(name := value_at(path, "file"), str) and name:
            yield place, name
