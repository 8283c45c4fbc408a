"""One example of a dataset as a folder with a stage, its textures and its layers: whole, or not there."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from dataset_builder.assets.field_file import read_field
from dataset_builder.engine.unit import FIELDS
from dataset_builder.errors import Problem, UserError
from dataset_builder.exporting.example_stage import StageParts, write_stage
from dataset_builder.exporting.placed_things import stage_contents
from dataset_builder.extras import missing_named
from dataset_builder.files import flush_folder, output_errors
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import PlacedObject
from dataset_builder.shards import exr
from dataset_builder.shards.example_key import key_of
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.reader import Dataset, open_dataset
from dataset_builder.spec.mesh_source import FIELD_SUFFIX

STAGE = "scene.usdc"


@dataclass(frozen=True, kw_only=True)
class ExportJob:
    """What to export, and whereto."""

    dataset: Path
    """Folder of a finished dataset."""
    key: str
    out: Path
    """Folder that is made."""
    mesh_root: Path
    """Folder that the label names files relative to: that of the dataset's spec."""
    fields: Path | None = None
    """Folder of the fields that were made for the dataset; None is where a build keeps them."""


@dataclass(frozen=True, kw_only=True)
class Exported:
    """What was written."""

    stage: Path
    things: int
    """Parts of the building and pieces of furniture, the target included."""
    triangles: int
    """Of all that, with the 3DM."""
    layers: tuple[str, ...]
    not_said: tuple[str, ...]
    """What of the example the stage does not say, in words."""


def export_usd(job: ExportJob) -> Exported:
    """Write the example into a folder beside `out`, and give it that name when it is whole.

    Raises UserError, with nothing written: no such dataset or key, files that the label names missing or changed,
    something there already, the field of the rough mesh not there, and without usd-core.
    """
    with missing_named():
        import pxr  # noqa: F401
    dataset = open_dataset(job.dataset)
    key = key_of(dataset, job.key)
    if job.out.exists() or job.out.is_symlink():
        raise UserError([Problem(where=str(job.out), path="", hint="name another folder with --out, or remove it",
                                 rule="expected no such folder yet, got one; nothing is overwritten")])
    label = dataset.label(key)
    _require_files(label.plan, job.mesh_root)
    fields = job.fields or job.dataset / WORK / FIELDS
    contents = stage_contents(label.plan, job.mesh_root, mesh_of_field(label, fields))
    out = job.out.absolute()
    with output_errors(job.out):
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as staging:
            folder = Path(staging) / out.name
            folder.mkdir()
            layers = _write_layers(dataset, key, folder)
            lost = write_stage(folder / STAGE, StageParts(label=label, contents=contents, layers=layers,
                                                          mesh_root=job.mesh_root))
            os.rename(folder, out)
        flush_folder(out.parent)
    things = (contents.target, *contents.around)
    return Exported(stage=job.out / STAGE, things=len(things), not_said=lost, layers=tuple(name for name, _ in layers),
                    triangles=sum(len(thing.soup.corners) for thing in things))


def _require_files(plan: ExamplePlan, root: Path) -> None:
    """Raise UserError for files that the label names and that are not there."""
    images = [light.image for lit in (plan.source_light, plan.target_light) for light in lit.lights]
    require_files([*sources(plan.target, *plan.furniture), plan.room.scene.file.source, *images], root)


def sources(*placed: PlacedObject) -> list[str]:
    """The files that objects are made from, as the label names them."""
    return [each.object.source for each in placed if each.object.kind != "procedural"]


def require_files(names: Iterable[str], root: Path) -> None:
    """Raise UserError for files that a label names relative to `root` and that are not there; empty names are none."""
    if missing := [name for name in dict.fromkeys(filter(None, names)) if not (root / name).is_file()]:
        raise UserError(Problem(where=str(root / name), path="", rule="expected a file that the example was made from, "
                                "found none", hint="give the folder of the dataset's spec with --meshes")
                        for name in missing)


def mesh_of_field(label: ExampleLabel, fields: Path | None) -> TriangleMesh | None:
    """The mesh that the R3DM is, where it is taken from a field that was made for the dataset; None where it is not.
    fields: the folder that keeps them. Raises UserError where the field is not there."""
    if not label.plan.rough.field.made:
        return None
    name = f"{label.record.field[-1].key}{FIELD_SUFFIX}"
    if fields is None or not (fields / name).is_file():
        raise UserError([Problem(where=str(fields / name) if fields else name, path="",
                                 rule="expected the field that the rough mesh is taken from, found none",
                                 hint="give the folder of the dataset's fields with --fields; a build makes them, and "
                                 f"keeps them in {WORK}/{FIELDS} of the dataset")])
    return read_field(fields / name).mesh


def _write_layers(dataset: Dataset, key: str, folder: Path) -> tuple[tuple[str, str], ...]:
    """Write every layer as it is stored; names, and files relative to the folder."""
    (folder / "layers").mkdir()
    found = list[tuple[str, str]]()
    for name, image in dataset.images(key):
        path = f"layers/{name}.exr"
        (folder / path).write_bytes(exr.encode(image.pixels, layer=name, key=key, dtype=image.dtype))
        found.append((name, path))
    return tuple(found)
