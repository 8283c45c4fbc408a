"""Rules that need more than one file or table: families and their limits, meshes, what splits share."""

import os
from collections.abc import Mapping
from pathlib import Path

from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.document import Document
from dataset_builder.spec.families import FAMILIES, Family
from dataset_builder.spec.licences import contradiction, licence_of
from dataset_builder.spec.mesh_source import MeshSource, broken_suffix_rule, companions, mesh_source, references
from dataset_builder.spec.numbers import AnyNumber, check_within
from dataset_builder.spec.problems import name_alike, nearest, shown
from dataset_builder.spec.scene import ObjectSpec, SceneSpec

NO_LICENCE = "expected a `licence` beside it, the key is missing"
LICENCE_OF_MESH = ("`licence: CC-BY-4.0`, or whatever SPDX identifier the mesh is published under; `CC0-1.0` only "
                   "where its author gave up all rights")

ALLOW = "give it others, or write `allow_shared: [{}]` in one of both splits"


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
            rule, hint = _companion_rule(path, Path(str(error.filename)))
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


def _companion_rule(path: Path, missing: Path) -> tuple[str, str]:
    """What is wrong where a file that a mesh file names is missing, and which statement names it."""
    named = next((each for each in references(path) if path.parent / each.name == missing), None)
    hints = [f"{named.by.name}, {named.key}" if named else "", name_alike(missing)]
    return (f"expected the files that {path.name} names, found no {missing.name} beside it",
            "; ".join(hint for hint in hints if hint))


def files_like(path: Path) -> str:
    """A hint: the file most like a missing one in its folder."""
    if not os.path.isdir(path.parent):
        return "its folder does not exist"
    return name_alike(path) or nearest(path.name, sorted(
        file.name for file in path.parent.iterdir() if file.suffix == path.suffix), "file")


def check_splits(dataset: DatasetSpec, document: Document, meshes: Mapping[str, MeshSource]) -> list[Problem]:
    """Mesh files that two splits share without a word, or that one split needs twice; families differ by their drawn
    parameters."""
    problems: list[Problem] = []
    owners: dict[str, str] = {}
    for number, split in enumerate(dataset.splits):
        files = [(index, meshes[key]) for index, key in enumerate(split.objects.source) if key in meshes]
        if files and split.objects.count > (most := len(split.objects.source)):
            rule = f"expected <= {most}, since each mesh file is one object, got {split.objects.count}"
            problems.append(document.problem(("splits", number, "objects", "count"), rule))
        for index, mesh in () if "objects" in split.allow_shared else files:
            owner = owners.setdefault(mesh.sha256, split.name)
            if owner != split.name:
                problems.append(document.problem(("splits", number, "objects", "from", index), "expected objects that "
                                                 f"no other split has, got a mesh file of split {owner}",
                                                 ALLOW.format("objects")))
    return problems


def check_scenes(dataset: DatasetSpec, document: Document, scenes: Mapping[str, SceneSpec],
                 files: Mapping[str, MeshSource]) -> list[Problem]:
    """Splits that take things of scenes which are rooms made in code, or one scene twice; paths in scenes that have
    cameras of their own; scene files that two splits share without a word."""
    problems: list[Problem] = []
    owners: dict[str, str] = {}
    for number, split in enumerate(dataset.splits):
        path = ("splits", number, "scenes")
        if split.objects.things and split.scenes.count > (most := len(split.scenes.source)):
            problems.append(document.problem((*path, "count"), f"expected <= {most}, since the things of a scene file "
                                             f"are the same each time, got {split.scenes.count}"))
        for index, key in enumerate(split.scenes.source):
            file = scenes[key].file if key in scenes else None
            if file is not None and file.cameras == "own" and dataset.camera_of(split.name).path:
                problems.append(document.problem((*path, "from", index), "expected cameras that a path places, got a "
                                                 f"scene that has its own: {shown(key)}",
                                                 "write `cameras: random` in the scene, or leave `camera.path` out"))
            if split.objects.things and key in scenes and scenes[key].file is None:
                problems.append(document.problem((*path, "from", index), "expected a scene from a file, since "
                                                 f"`objects.things` takes its things, got a room: {shown(key)}",
                                                 "name objects with `objects.from`, or give the scene a `file`"))
            if "scenes" in split.allow_shared or key not in files:
                continue
            if (owner := owners.setdefault(files[key].digest, split.name)) != split.name:
                problems.append(document.problem((*path, "from", index), "expected scenes that no other split has, "
                                                 f"got a scene file of split {owner}", ALLOW.format("scenes")))
    return problems


def check_lamps(dataset: DatasetSpec, document: Document, scenes: Mapping[str, SceneSpec]) -> list[Problem]:
    """Splits with several lights for each view where none is drawn, all of which would be equal; and lamps that are to
    shine alone in scenes with lights of their own."""
    problems: list[Problem] = []
    for number, split in enumerate(dataset.splits):
        path = ("splits", number, "lights")
        own = [file.lights for key in split.scenes.source if key in scenes and (file := scenes[key].file) is not None
               and file.lights.use != "replaced"]
        if split.lights == "each" and own:
            problems.append(document.problem(path, "expected a number where scenes have lights of their own, got each",
                                             "write `use: replaced` in the scene's `lights`"))
        elif not dataset.target.drawn and not own and split.lights not in ("each", 1):
            problems.append(document.problem(path, "expected 1 or each, since nothing about the lamps of `target` is "
                                             f"drawn and all lights of a view would be equal, got {split.lights}",
                                             "draw a number of a lamp, as `dim: {uniform: [0.5, 1]}`"))
    return problems


def check_licence(dataset: DatasetSpec, document: Document, parts: Mapping[str, str]) -> str | Problem:
    """The licence of a dataset of parts with these licences, by the files that say so: the given one, or what follows
    from theirs; or what is wrong."""
    if not dataset.licence:
        found, why = licence_of(parts)
        rule = f"expected a `licence` of the dataset, since none follows from its objects: {why}"
        return found or document.problem((), rule, "write `licence:` and the SPDX identifier it is to have, or leave "
                                                   "the object out")
    if why := contradiction(dataset.licence, parts):
        return document.problem(("licence",), f"expected one that its objects allow, got {dataset.licence}: {why}",
                                "leave the key out, and it follows from the objects")
    return dataset.licence
