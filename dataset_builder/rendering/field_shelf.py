"""Where fields are kept: files by the digest of all that they were made from. Nothing here makes one."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Literal

from dataset_builder.assets.field_file import FieldFile, read_field
from dataset_builder.errors import UserError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.rendering.pass_inputs import field_inputs, key_of
from dataset_builder.spec.mesh_source import FIELD_SUFFIX

KEPT = 2
"""Fields in memory."""


@dataclass(frozen=True, kw_only=True)
class FieldTask:
    """One field that examples need."""

    object: ObjectPlan
    field: FieldPlan

    def __str__(self) -> str:
        return f"{self.field.kind} field of {self.object.name}"


@dataclass(frozen=True, kw_only=True)
class FieldProgress:
    """How far the making of a field is."""

    stage: Literal["images", "fit"]
    step: int
    """Images or steps that are done."""
    steps: int
    """Of all of them."""
    loss: float = 0.0
    """Of a fit."""
    psnr: float = 0.0
    """Of a fit, inside of the masks of images that it is fitted to, dB."""


@dataclass(frozen=True, kw_only=True)
class FieldShelf:
    """Fields of one folder."""

    folder: Path | None = None
    """None where no plan may ask for a field that is no object's own."""
    made_by: Mapping[str, str] = field(default_factory=dict)
    """Versions of whatever makes them."""

    def key(self, task: FieldTask) -> str:
        """Digest of all that a field is made from, its own file's where it is an object's own."""
        return task.object.source_sha256 if task.field.kind == "own" else key_of(
            field_inputs(task.object, task.field), dict(self.made_by))

    def path(self, task: FieldTask, mesh_root: Path) -> Path:
        """File of a field, whether or not it is there."""
        if task.field.kind == "own":
            return mesh_root / task.object.source
        if self.folder is None:
            raise UserError("expected a folder for fields, got none")
        return self.folder / f"{self.key(task)}{FIELD_SUFFIX}"

    def get(self, task: FieldTask, mesh_root: Path) -> FieldFile:
        """A field. Raises UserError where it was not made, or where its file is damaged."""
        path = self.path(task, mesh_root)
        return _read(path, self.key(task), _stamp(path))

    def find(self, task: FieldTask, mesh_root: Path) -> FieldFile | None:
        """A field; None where it was not made, or where its file is damaged."""
        with suppress(UserError):
            return self.get(task, mesh_root)
        return None


NO_SHELF = FieldShelf()


@lru_cache(maxsize=KEPT)
def _read(path: Path, key: str, stamp: tuple[int, int]) -> FieldFile:
    """key, stamp: what it was made from, and when, so that another file in its place is read anew."""
    return read_field(path)


def _stamp(path: Path) -> tuple[int, int]:
    """When a file was written, in ns, and its bytes; zeros where there is none."""
    with suppress(OSError):
        found = path.stat()
        return found.st_mtime_ns, found.st_size
    return 0, 0


def tasks_of(plan: ExamplePlan) -> tuple[FieldTask, ...]:
    """The fields that an example needs: of `i_s`, then of the R3DM, each once."""
    wanted = [FieldTask(object=plan.target.object, field=field) for field in (plan.field, plan.rough.field)
              if field.there]
    return tuple(dict.fromkeys(wanted))
