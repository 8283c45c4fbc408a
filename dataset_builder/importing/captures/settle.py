"""A field that was fitted about right to one that stands on the floor at its exact height, and its object spec."""

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.errors import printable
from dataset_builder.geometry.mesh import TriangleMesh

GROUND = 1.0
"""Percentile of the heights of the mesh that is the ground: single lumps below it do not lift the rest."""


def settled(content: FieldFile, height: float | None) -> FieldFile:
    """The field moved, so that its mesh stands on z = 0 over the origin, and scaled to a height in metres, if one is
    given. What of the mesh lies below the ground is pressed flat."""
    positions = content.mesh.positions
    low, high = content.mesh.bounds
    ground = float(np.percentile(positions[np.unique(content.mesh.faces)][:, 2], GROUND))
    scale = height / (high[2] - ground) if height else 1.0
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, ground])
    moved = scale * (positions - origin)
    moved[:, 2] = np.maximum(moved[:, 2], 0)
    mesh = content.mesh
    x, y, z = (scale * (np.array(content.centre) - origin)).tolist()
    return replace(content, centre=(x, y, z), radius=scale * content.radius,
                   mesh=TriangleMesh(positions=moved, faces=mesh.faces, uvs=mesh.uvs, material=mesh.material,
                                     colors=mesh.colors))


def moved_poses(poses: np.ndarray, before: FieldFile, after: FieldFile) -> np.ndarray:
    """(N, 4, 4) poses in the frame of the field that was settled, of those before."""
    scale = after.radius / before.radius
    moved = poses.copy()
    moved[:, :3, 3] = scale * (poses[:, :3, 3] - before.centre) + after.centre
    return moved


def spec_text(file: str, *, category: str, licence: str, notes: Sequence[str]) -> str:
    """The object spec of a field's file beside it."""
    about = "".join(f"# {printable(note)}\n" for note in notes)
    return (f"# Written by `dataset-builder import capture`\n{about}"
            f"file: {json.dumps(file)}\ncategory: {json.dumps(category, ensure_ascii=False)}\nlicence: {licence}\n")
