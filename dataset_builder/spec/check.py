"""Rules that need more than one file or table: families and their limits, meshes, images, splits that share nothing."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dataset_builder.digest import sha256_file
from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.document import Document
from dataset_builder.spec.families import FAMILIES, Family
from dataset_builder.spec.file_reference import MOST_BYTES
from dataset_builder.spec.licences import contradiction, licence_of
from dataset_builder.spec.mesh_source import MeshSource, broken_suffix_rule, companions, mesh_source
from dataset_builder.spec.numbers import AnyNumber, check_within
from dataset_builder.spec.problems import nearest, shown
from dataset_builder.spec.scene import ObjectSpec

ENVIRONMENT_SUFFIXES = (".exr", ".hdr")
TEXTURE_SUFFIXES = (".exr", ".png")
"""Files that an environment, and the texture of a lamp, may be."""
KeyPath = tuple[str | int, ...]
NO_LICENCE = "expected a `licence` beside it, the key is missing"
LICENCE_OF_MESH = ("`licence: CC-BY-4.0`, or whatever SPDX identifier the mesh is published under; `CC0-1.0` only "
                   "where its author gave up all rights")


def find_images(document: Document, folder: Path) -> tuple[dict[str, str], list[Problem]]:
    """SHA-256 of every image that a dataset file in `folder` names, by the name written there; and what is wrong.

    What is in an image is looked at when it is rendered.
    """
    digests, problems = dict[str, str](), list[Problem]()
    for path, name, suffixes in _named(document.data):
        file = folder / name
        rule, hint = _image_rule(file, name, suffixes)
        if not rule and name not in digests:
            try:
                digests[name] = sha256_file(file, most=MOST_BYTES)
            except OSError as error:
                rule = f"expected a readable image, got: {error.strerror}"
        if rule:
            problems.append(document.problem(path, rule, hint))
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
        if isinstance(name := _at(_at(data, part), "environment"), str) and name:
            yield (part, "environment"), name, ENVIRONMENT_SUFFIXES
    textures = _at(_at(data, "target"), "textures")
    for index, name in enumerate(textures if isinstance(textures, tuple) else ()):
        if isinstance(name, str):
            yield ("target", "textures", index), name, TEXTURE_SUFFIXES


def _at(data: Any, key: str) -> Any:
    return data.get(key) if isinstance(data, dict) else None


def check_object(spec: ObjectSpec, document: Document) -> list[Problem]:
    """What is wrong with the family of an object and its parameters, or with a mesh file's licence."""
    if spec.family is None:
        return [] if spec.licence else [document.problem(("file",), NO_LICENCE, "write " + LICENCE_OF_MESH)]
    family = FAMILIES.get(spec.family)
    if family is None:
        hint = nearest(spec.family, [*FAMILIES])
        return [document.problem(("family",), f"expected a family, got {shown(spec.family)}", hint)]
    problems = []
    for name, value in spec.params.items():
        if broken := _param_rule(family, name, value):
            problems.append(document.problem(("params", name), *broken))
    return problems


def _param_rule(family: Family, name: str, value: AnyNumber) -> tuple[str, str] | None:
    """The rule that a parameter breaks, and a hint."""
    names = [param.name for param in family.params]
    if name not in names:
        return f"expected a parameter of {family.name}, got {shown(name)}", nearest(name, names)
    param = family.param(name)
    try:
        check_within(value, param.low, param.high)
    except ValueError as error:
        return str(error), f"{param.meaning}, unit {param.unit}" if param.unit else param.meaning
    return None


def find_mesh(spec: ObjectSpec, document: Document, folder: Path) -> MeshSource | Problem | None:
    """The mesh file of an object whose spec lies in `folder`, what is wrong with it, or None where it has a family."""
    if spec.file is None:
        return None
    path = folder / spec.file
    rule, hint = _mesh_rule(path, spec.file)
    if not rule:
        try:
            return mesh_source(path, companions(path))
        except FileNotFoundError as error:
            rule = f"expected the files that {spec.file} names, found no {Path(str(error.filename)).name} beside it"
        except OSError as error:
            rule = f"expected a readable mesh file, got: {error.strerror}"
        except ValueError as error:
            rule = f"expected a {path.suffix} file, got one that cannot be read: {error}"
        except UserError as error:
            rule = "; ".join(problem.rule for problem in error.problems)
    return document.problem(("file",), rule, hint)


def _mesh_rule(path: Path, name: str) -> tuple[str, str]:
    rule, hint = broken_suffix_rule(name)
    if rule:
        return rule, hint
    if not os.path.isfile(path):
        return f"expected a mesh file, found none at {shown(name)}", files_like(path)
    return "", ""


def files_like(path: Path) -> str:
    """A hint: the file most like a missing one in its folder."""
    if not os.path.isdir(path.parent):
        return "its folder does not exist"
    return nearest(path.name, sorted(file.name for file in path.parent.iterdir() if file.suffix == path.suffix), "file")


def check_splits(dataset: DatasetSpec, document: Document, meshes: Mapping[str, MeshSource]) -> list[Problem]:
    """Mesh files that two splits share, or that one split needs twice; families differ by their drawn parameters."""
    problems: list[Problem] = []
    owners: dict[str, str] = {}
    for number, split in enumerate(dataset.splits):
        files = [(index, meshes[key]) for index, key in enumerate(split.objects.source) if key in meshes]
        if files and split.objects.count > (most := len(split.objects.source)):
            rule = f"expected <= {most}, since each mesh file is one object, got {split.objects.count}"
            problems.append(document.problem(("splits", number, "objects", "count"), rule))
        for index, mesh in files:
            owner = owners.setdefault(mesh.sha256, split.name)
            if owner != split.name:
                problems.append(document.problem(("splits", number, "objects", "from", index), "expected objects that "
                                                 f"no other split has, got a mesh file of split {owner}"))
    return problems


def check_licence(dataset: DatasetSpec, document: Document, objects: Mapping[str, ObjectSpec]) -> str | Problem:
    """The licence of a dataset with these objects: the given one, or what follows from theirs; or what is wrong."""
    parts = {key: spec.licence for key, spec in objects.items() if spec.licence}
    if not dataset.licence:
        found, why = licence_of(parts)
        rule = f"expected a `licence` of the dataset, since none follows from its objects: {why}"
        return found or document.problem((), rule, "write `licence:` and the SPDX identifier it is to have, or leave "
                                                   "the object out")
    if why := contradiction(dataset.licence, parts):
        return document.problem(("licence",), f"expected one that its objects allow, got {dataset.licence}: {why}",
                                "leave the key out, and it follows from the objects")
    return dataset.licence
