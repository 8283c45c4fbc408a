"""A folder of 3D-FRONT scenes to their index: files read by several processes, told of in order of name."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.digest import sha256_file
from dataset_builder.engine.local import run
from dataset_builder.engine.source import source_digest
from dataset_builder.errors import Problem, UserError
from dataset_builder.importing.index_file import IndexFile
from dataset_builder.importing.read_scene import read_scene
from dataset_builder.importing.scene_index import SceneIndex, index_line
from dataset_builder.spec.front3d_references import MODEL_LIST

MADE_BY = "importing.read_scene"
"""What turns a scene into its line."""
Watch = Callable[[Iterable["IndexedFile"], int], Iterable["IndexedFile"]]
"""Gives files back one by one; of how many."""


@dataclass(frozen=True)
class _File:
    number: int
    path: Path
    known: str
    """Digest that the index has of it; empty where it has none."""

    def __str__(self) -> str:
        return str(self.path)


@dataclass(frozen=True, kw_only=True)
class IndexedFile:
    """What became of one file."""

    number: int
    """In order of name."""
    size: int
    """Bytes."""
    line: str
    """Of the index; empty where it has one already that holds."""


@dataclass(frozen=True, kw_only=True)
class FolderIndex:
    """All scenes of a folder."""

    scenes: tuple[SceneIndex, ...]
    """In order of name."""
    read: int
    """Files that were read; of the others the index had told already."""
    read_bytes: int


def scene_files(folder: Path) -> list[Path]:
    """The JSON files of a folder in order of name, without hidden ones and `model_info.json`. Raises UserError where
    the folder is not there or holds none."""
    try:
        found = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".json" and path.name != MODEL_LIST
                       and not path.name.startswith(".") and path.is_file())
    except OSError as error:
        rule = f"expected a folder of 3D-FRONT scenes, got: {error.strerror}"
        raise UserError([Problem(where=str(folder), path="", rule=rule)]) from error
    if not found:
        below = sorted({path.parent for path in folder.glob("*/*.json") if path.name != MODEL_LIST})
        raise UserError([Problem(where=str(folder), path="", rule="expected a folder with the scenes of 3D-FRONT, one "
                                 "JSON file each, found no JSON file", hint=f"perhaps {below[0]}" if below else
                                 "name the folder that 3D-FRONT.zip was unpacked into")])
    return found


def index_folder(folder: Path, index: IndexFile, *, workers: int, watch: Watch) -> FolderIndex:
    """Read every scene of a folder that `index` does not hold yet, and append it there.

    Files that cannot be read are scenes that are broken. The order of the lines does not depend on `workers`. Raises
    UserError as `scene_files` does, OutputError where the index cannot be written or a process dies again and again;
    lines that were written before are kept.
    """
    files = scene_files(folder)
    known = {name: scene.sha256 for name, scene in index.known.items()}
    units = (_File(number, path, known.get(path.name, "")) for number, path in enumerate(files))
    read = size = 0
    for done in _in_order(watch(run(_index, units, workers=min(workers, len(files))), len(files))):
        if done.line:
            index.append(done.line)
            read, size = read + 1, size + done.size
    return FolderIndex(scenes=tuple(index.known[path.name] for path in files), read=read, read_bytes=size)


def made_by() -> str:
    """Digest of the code that makes lines."""
    return source_digest(MADE_BY)


def _index(file: _File) -> IndexedFile:
    """Read one file, unless its digest is the one that is known."""
    number, path, known = file.number, file.path, file.known
    if not path.name.isprintable():
        line = index_line(SceneIndex(file=path.name, sha256="", size=0, broken="its name holds control characters or "
                                     "bytes that are not UTF-8: rename it"))
        return IndexedFile(number=number, size=0, line=line)
    try:
        size, sha256 = path.stat().st_size, sha256_file(path)
    except OSError as error:
        scene = SceneIndex(file=path.name, sha256="", size=0, broken=f"cannot be opened: {error.strerror}")
        return IndexedFile(number=number, size=0, line=index_line(scene))
    if known and sha256 == known:
        return IndexedFile(number=number, size=size, line="")
    scene, faults = read_scene(path, sha256)
    return IndexedFile(number=number, size=size, line=index_line(scene, faults))


def _in_order(files: Iterable[IndexedFile]) -> Iterator[IndexedFile]:
    """Files by number, whatever order they come in; a few wait for those before them."""
    waiting, following = dict[int, IndexedFile](), 0
    for each in files:
        waiting[each.number] = each
        while following in waiting:
            yield waiting.pop(following)
            following += 1
