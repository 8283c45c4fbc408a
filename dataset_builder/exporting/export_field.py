"""A field's file -> a file of splats, or of its mesh, by the suffix of its name."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dataset_builder.assets.field_file import read_field
from dataset_builder.errors import UserError
from dataset_builder.exporting import field_formats
from dataset_builder.files import write_atomic
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.mesh_splats import splats_of_mesh
from dataset_builder.geometry.splat_cloud import SplatCloud

Content = Literal["splats", "mesh"]
SPLATS: dict[str, Callable[[SplatCloud, str], bytes]] = {
    ".ply": lambda cloud, _: field_formats.splats_ply(cloud),
    **dict.fromkeys((".usd", ".usda", ".usdc"), field_formats.splats_usd)}
MESHES: dict[str, Callable[[TriangleMesh, str], bytes]] = {
    ".glb": lambda mesh, _: field_formats.mesh_glb(mesh), ".ply": lambda mesh, _: field_formats.mesh_ply(mesh),
    **dict.fromkeys((".usd", ".usda", ".usdc"), field_formats.mesh_usd)}


@dataclass(frozen=True, kw_only=True)
class FieldExport:
    """What was written."""

    content: Content
    count: int
    """Splats, or triangles."""
    made: bool
    """Whether the splats were made of the mesh, since the field has none."""


def export_field(source: Path, out: Path, content: Content | None = None) -> FieldExport:
    """Write a field as splats, or as its mesh; by default as splats where the format can hold them.

    A field that is a grid has one splat made for each vertex of its mesh, flat and of one colour. Raises UserError for
    a file that is no field, an `out` that is there already, a suffix that is not written, and splats of linear colours
    as .ply, which cannot say so; OutputError where it cannot be written.
    """
    suffix = out.suffix.lower()
    chosen = content or ("splats" if suffix in SPLATS else "mesh")
    writers = SPLATS if chosen == "splats" else MESHES
    if suffix not in writers:
        raise UserError(f"{out}: expected a name for {chosen} that ends in one of {' '.join(sorted(writers))}")
    if out.exists() or out.is_symlink():
        raise UserError(f"{out}: expected no such file yet, got one; nothing is overwritten (remove it, or name "
                        "another)")
    field = read_field(source)
    if chosen == "mesh":
        write_atomic(out, MESHES[suffix](field.mesh, suffix))
        return FieldExport(content=chosen, count=len(field.mesh.faces), made=False)
    cloud = splats_of_mesh(field.mesh) if field.splats is None else field.splats
    if suffix == ".ply" and not cloud.srgb:
        raise UserError(f"{out}: expected splats with sRGB-encoded colours, as readers of .ply take them to be, got "
                        "linear ones; write them as .usda, which says so")
    write_atomic(out, SPLATS[suffix](cloud, suffix))
    return FieldExport(content=chosen, count=len(cloud), made=field.splats is None)
