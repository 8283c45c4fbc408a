"""The index of a folder as a file: a line for each scene, appended as they are read, so that nothing is read twice."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from dataset_builder.assets.scene_readers.front3d_values import SceneFault
from dataset_builder.digest import open_regular
from dataset_builder.errors import Problem, UserError
from dataset_builder.files import output_errors
from dataset_builder.importing.scene_index import SceneIndex, scene_of_line

FORMAT = "index of 3D-FRONT scenes"


class IndexFile:
    """Lines of scenes, to go on with where they were written by the same code; a context that closes the file.

    A line that was cut off is removed. Raises UserError where something else lies there, OutputError where it cannot
    be written.
    """

    def __init__(self, path: Path, made_by: str) -> None:
        self.path = path
        self.head = json.dumps({"format": FORMAT, "made_by": made_by})
        self.known: dict[str, SceneIndex] = {}
        """Scenes by name of their file; the last line of a file holds."""
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            end = self._read()
            self.stream = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666), "r+b")
            self.stream.truncate(end)
            self.stream.seek(end)
            if end == 0:
                self._write(self.head)

    def __enter__(self) -> "IndexFile":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.stream.close()

    def append(self, line: str) -> None:
        """Add a scene, whole or, where the disk is full or the process dies, to be cut off later. Raises OutputError.
        """
        scene, _ = scene_of_line(line)
        with output_errors(self.path):
            self._write(line)
        self.known[scene.file] = scene

    def told(self) -> Iterator[tuple[SceneIndex, tuple[SceneFault, ...]]]:
        """Every scene whose line holds, with its faults, in order of the file: one at a time."""
        left = dict(self.known)
        with open_regular(self.path) as stream:
            next(stream, None)
            for line in stream:
                scene, faults = scene_of_line(line.decode())
                if left.get(scene.file) == scene:
                    del left[scene.file]
                    yield scene, faults

    def _write(self, line: str) -> None:
        self.stream.write(line.encode() + b"\n")
        self.stream.flush()

    def _read(self) -> int:
        """Take up what is there; the number of bytes that hold."""
        if not os.path.lexists(self.path):
            return 0
        with open_regular(self.path) as stream:
            head = stream.readline()
            if head and not head.startswith(self.head[:self.head.index(", ")].encode()):
                raise UserError([Problem(where=str(self.path), path="", rule=f"expected an {FORMAT}, got another file",
                                         hint="name another folder with --out, or remove it")])
            if head != self.head.encode() + b"\n":
                return 0
            end = len(head)
            for line in stream:
                try:
                    scene, _ = scene_of_line(line.decode())
                except ValueError:
                    break
                if not line.endswith(b"\n"):
                    break
                self.known[scene.file] = scene
                end += len(line)
        return end
