"""Fields as mesh files: the mesh of a capture, in the colours that the field shows."""

from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.assets.field_file import read_field
from dataset_builder.assets.file_model import ROUGHNESS, FileMaterial, FileModel, FilePart
from dataset_builder.geometry.mesh import TriangleMesh

LEFT_OUT = ("the colours of its mesh are radiance in the light of its images, not reflectance",)


def read(path: Path, max_texture: int) -> FileModel:
    """The mesh of a field, Y up as files are taken to be: a matt surface in the field's colours. Raises UserError where
    the file is no whole field."""
    del max_texture
    mesh = read_field(path).mesh
    parts = (_part(mesh),) if len(mesh.faces) else ()
    matt = Material(name="capture", base_color=(1.0, 1.0, 1.0), roughness=ROUGHNESS, specular=0.0)
    return FileModel(parts=parts, materials=(FileMaterial(material=matt),), left_out=LEFT_OUT, wound=True,
                     contains=f"a field with a mesh of {len(mesh.faces):,} triangles")


def _part(mesh: TriangleMesh) -> FilePart:
    x, y, z = mesh.positions.T
    return FilePart(name="the field's mesh", positions=np.stack([x, z, -y], axis=1), faces=mesh.faces, material=0,
                    colors=mesh.colors)
