"""A file of splats to a field with its mesh, and the object spec that names it."""

from dataclasses import dataclass
from pathlib import Path

from dataset_builder.assets.field_file import encode
from dataset_builder.assets.splat_file import upward
from dataset_builder.files import output_errors, require_writable, write_atomic
from dataset_builder.importing.captures.settle import check_options, spec_text
from dataset_builder.importing.in_place import refuse_existing
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.rendering.field.splat_field import CELLS, SplatStance
from dataset_builder.rendering.splat_capture import captured_splats

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class SplatJob:
    """What is asked for."""

    file: Path
    out: Path
    name: str
    """Of the object and its files."""
    licence: str
    """SPDX identifier of the capture."""
    category: str
    up: Vector | None = None
    """What points up in the file's axes; None for what usually does in files of its format."""
    yaw: float = 0.0
    height: float | None = None
    """Of the object, metres; None where a unit of the file is a metre."""
    white: float | None = None
    """Radiance of white paper; None to follow from the object's median."""
    srgb: bool | None = None
    """Whether colours are sRGB-encoded; None as the file says."""
    box: tuple[Vector, Vector] | None = None
    ball: tuple[float, float, float, float] | None = None
    cells: int = CELLS

    @property
    def files(self) -> tuple[str, str]:
        """Field and spec, in the output folder."""
        return f"{self.name}.npz", f"{self.name}.yaml"


@dataclass(frozen=True, kw_only=True)
class ImportedSplats:
    """What was written."""

    files: tuple[Path, ...]
    splats: int
    triangles: int
    size: tuple[float, float, float]
    """Of the mesh, metres."""
    record: FieldRecord
    notes: tuple[str, ...]


def import_splats(job: SplatJob) -> ImportedSplats:
    """Write a field and its spec for a file of splats. Raises UserError, with nothing written, for whatever is wrong
    with the file or the options, or where a file is there already."""
    check_options(licence=job.licence, name=job.name, yaw=job.yaw,
                  numbers={"--height": job.height, "--white": job.white})
    refuse_existing(job.out, job.files)
    require_writable(job.out)
    x, y, z = upward(job.file).tolist()
    stance = SplatStance(up=job.up or (x, y, z), yaw=job.yaw, height=job.height, box=job.box, ball=job.ball)
    found = captured_splats(job.file, stance, srgb=job.srgb, white=job.white, cells=job.cells)
    notes = (*found.notes, *([] if job.up else [f"up is {_axis((x, y, z))}, as usual for {job.file.suffix} files"]),
             *([] if job.height else ["no height is given: a unit of the file is taken for a metre"]))
    field, spec = job.files
    with output_errors(job.out):
        write_atomic(job.out / field, encode(found.field))
        write_atomic(job.out / spec, spec_text(field, category=job.category, licence=job.licence,
                                               notes=notes).encode())
    assert found.field.splats is not None
    return ImportedSplats(files=(job.out / field, job.out / spec), splats=len(found.field.splats),
                          triangles=len(found.field.mesh.faces), size=found.field.mesh.size,
                          record=found.field.record, notes=notes)


def _axis(up: Vector) -> str:
    return next(f"{'-' if value < 0 else ''}{name}" for name, value in zip("xyz", up, strict=True) if value)
