"""Scene files that a spec names: what files they consist of, the digest of all of it, and what is wrong with them."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from dataset_builder.digest import sha256_file
from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.check import files_like
from dataset_builder.spec.document import Document
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.file_reference import MOST_BYTES, FileReference
from dataset_builder.spec.file_scene import SceneFileSpec
from dataset_builder.spec.front3d_references import front3d_references
from dataset_builder.spec.mesh_source import (
    FIELD_SUFFIX,
    MESH_SUFFIXES,
    MeshSource,
    OutsideError,
    broken_suffix_rule,
    references,
)
from dataset_builder.spec.problems import name_alike, nearest, shown
from dataset_builder.spec.usd_references import USD_SUFFIXES

KEPT_DIGESTS = 1 << 16
FRONT_SUFFIX = ".json"
"""Of scenes of 3D-FRONT."""


@dataclass(frozen=True, kw_only=True)
class SceneFolders:
    """Where a scene file lies, and what else it may be made of. Paths as they can be opened."""

    path: Path
    """The scene file."""
    roots: tuple[Path, ...] = ()
    """Folders, beside its own, that it may name files in."""
    models: Path | None = None
    """Folder of the models of a 3D-FRONT scene."""
    textures: Path | None = None
    """Folder of the textures of a 3D-FRONT scene."""

    @classmethod
    def of(cls, folder: Path, path: str, roots: Iterable[str], models: str, textures: str) -> "SceneFolders":
        """Of paths relative to `folder`; an empty one is none."""
        return cls(path=folder / path, roots=tuple(folder / root for root in roots),
                   models=folder / models if models else None, textures=folder / textures if textures else None)


SCENE_REFERENCES: dict[str, Callable[[SceneFolders], Iterable[FileReference]]] = {
    **dict.fromkeys(MESH_SUFFIXES, lambda scene: references(scene.path, scene.roots)),
    FRONT_SUFFIX: lambda scene: front3d_references(scene.path, scene.models, scene.textures)}
"""What finds the files that a scene file needs, by its suffix: names relative to the folder of the scene file. A file
that the scene can do without, and that is not there, is none of them."""


def scene_files(scene: SceneFolders) -> MeshSource:
    """The scene file and all that it needs, with their digests.

    Files are named by the folder that they lie in, so that the digest stays when models move. Raises OSError where one
    cannot be read, ValueError and UserError where the scene cannot be understood that far.
    """
    found = {_named(scene, reference.name): scene.path.parent / reference.name
             for reference in SCENE_REFERENCES[scene.path.suffix.lower()](scene)}
    return MeshSource(path=scene.path.resolve(), sha256=_digest_of(scene.path), companions=MappingProxyType(
        {name: _digest_of(file) for name, file in sorted(found.items())}))


def _named(scene: SceneFolders, name: str) -> str:
    """A file by the folder of the scene that it lies in: `models/a/raw_model.obj`."""
    file = os.path.abspath(scene.path.parent / name)
    folders = [("", scene.path.parent), ("models", scene.models), ("textures", scene.textures),
               *((f"roots[{number}]", root) for number, root in enumerate(scene.roots))]
    for called, folder in folders:
        if folder is not None and file.startswith(os.path.join(os.path.abspath(folder), "")):
            return f"{called}/{Path(os.path.relpath(file, folder)).as_posix()}".lstrip("/")
    return name


def _digest_of(file: Path) -> str:
    """SHA-256 of a file; scenes share models, so the digest of one that has not changed is kept."""
    found = os.stat(file)
    return _digest_at(str(file), found.st_size, found.st_mtime_ns, found.st_ino)


@lru_cache(maxsize=KEPT_DIGESTS)
def _digest_at(file: str, size: int, changed: int, number: int) -> str:
    return sha256_file(Path(file), most=MOST_BYTES)


def find_scene(spec: SceneFileSpec, document: Document, folder: Path) -> MeshSource | list[Problem]:
    """The files of a scene whose spec lies in `folder`, or all that is wrong with what the spec says of it."""
    problems = [document.problem(("file", *path), rule, hint) for path, rule, hint in _broken(spec, document, folder)]
    if problems:
        return problems
    scene = SceneFolders.of(folder, spec.path, spec.roots, spec.models, spec.textures)
    try:
        return scene_files(scene)
    except FileNotFoundError as error:
        missing = Path(os.path.normpath(str(error.filename)))
        rule = f"expected the files that {scene.path.name} names, found no {missing.name} in {missing.parent}"
        hint = name_alike(missing) or "put it there, or export the scene again with its files"
    except OSError as error:
        rule, hint = f"expected a readable scene file, got: {error.strerror}", ""
    except OutsideError as error:
        rule, hint = str(error), "put it there, or name its folder in `roots`"
    except ValueError as error:
        rule, hint = f"expected a {scene.path.suffix} file, got one that cannot be read: {error}", ""
    except UserError as error:
        rule, hint = "; ".join(problem.rule for problem in error.problems), ""
    return [document.problem(("file", "path"), rule, hint)]


def _broken(spec: SceneFileSpec, document: Document, folder: Path) -> Iterable[tuple[KeyPath, str, str]]:
    """Path below `file`, rule and hint of all that is wrong with paths and with keys that the format has no use for."""
    suffix = Path(spec.path).suffix.lower()
    if suffix not in SCENE_REFERENCES:
        known = f"expected a scene file that ends in one of {' '.join(SCENE_REFERENCES)}, got {shown(spec.path)}"
        yield ("path",), known, broken_suffix_rule(spec.path)[1]
    elif not os.path.isfile(folder / spec.path):
        yield ("path",), f"expected a scene file, found none at {shown(spec.path)}", files_like(folder / spec.path)
    named = [(("roots", number), root) for number, root in enumerate(spec.roots)]
    for path, name in [*named, (("models",), spec.models), (("textures",), spec.textures)]:
        if name and not os.path.isdir(folder / name):
            yield path, f"expected a folder, found none at {shown(name)}", _folders_like(folder / name)
    for key, suffixes in _ONLY.items():
        if suffix in SCENE_REFERENCES and suffix not in suffixes and key in _said(document.data):
            yield (key,), f"expected no `{key}` for a {suffix} file, got {shown(_said(document.data)[key])}", \
                f"it is for {' '.join(suffixes)}"


_ONLY = {"models": (FRONT_SUFFIX,), "textures": (FRONT_SUFFIX,), "variants": USD_SUFFIXES,
         "up": tuple(suffix for suffix in MESH_SUFFIXES if suffix not in (*USD_SUFFIXES, FIELD_SUFFIX)),
         "roots": tuple(suffix for suffix in MESH_SUFFIXES)}
"""Keys that only files of some suffixes have a use for."""


def _said(data: object) -> dict[str, object]:
    """What a scene spec writes under `file`."""
    found = data.get("file") if isinstance(data, dict) else None
    return found if isinstance(found, dict) else {}


def _folders_like(path: Path) -> str:
    """A hint: the folder most like a missing one beside it."""
    if not os.path.isdir(path.parent):
        return "the folder that it should lie in does not exist"
    return nearest(path.name, sorted(each.name for each in path.parent.iterdir() if each.is_dir()), "folder")
