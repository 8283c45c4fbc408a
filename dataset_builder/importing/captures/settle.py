"""A field that was fitted about right to one that stands on the floor at its exact height; its object spec, and what
may stand there."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.errors import Problem, UserError, printable
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.seeding import SEED_BITS

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


def check_options(*, licence: str, name: str, yaw: float, numbers: Mapping[str, float | None], seed: int = 0) -> None:
    """Raise UserError that tells every option that is none: of what the spec says, and of `numbers` by option, which
    are above 0."""
    wrong = []
    if not re.fullmatch(r"[A-Za-z0-9.+-]{1,100}", licence):
        wrong.append(("--licence", "expected the SPDX identifier of the capture's licence, such as CC-BY-4.0, got "
                                   f"{licence or 'none'}"))
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}", name):
        wrong.append(("--name", f"expected letters, digits, _, . and -, got {name}"))
    wrong += [(option, f"expected a number above 0, got {value:g}") for option, value in numbers.items()
              if value is not None and not 0 < value < 1e6]
    if not abs(yaw) < 1e6:
        wrong.append(("--yaw", f"expected a number of degrees, got {yaw:g}"))
    if not 0 <= seed < 2**SEED_BITS:
        wrong.append(("--seed", f"expected a whole number from 0 to 2**{SEED_BITS} - 1, got {seed}"))
    if wrong:
        raise UserError(Problem(where="", path=option, rule=rule) for option, rule in wrong)


def spec_text(file: str, *, category: str, licence: str, notes: Sequence[str]) -> str:
    """The object spec of a field's file beside it."""
    about = "".join(f"# {printable(note)}\n" for note in notes)
    return (f"# Written by `dataset-builder import capture`\n{about}"
            f"file: {json.dumps(file)}\ncategory: {json.dumps(category, ensure_ascii=False)}\nlicence: {licence}\n")
