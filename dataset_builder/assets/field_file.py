"""A field as a file: what an object looks like from all sides, the mesh taken from it, and its figures. No pickle."""

import json
import zipfile
import zlib
from dataclasses import dataclass, field, fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from dataset_builder.errors import Problem, UserError
from dataset_builder.files import write_atomic
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.label.field_record import FieldRecord

FORMAT = 1
"""Of the file; a reader takes no other."""
ZIP = b"PK\x03\x04"
"""What such a file starts with; NumPy takes everything else for a pickle."""
UNREADABLE = (OSError, ValueError, LookupError, TypeError, AttributeError, EOFError, MemoryError, NotImplementedError,
              RecursionError, UserError, ValidationError, zipfile.BadZipFile, zlib.error)
"""What reading damaged bytes raises."""
CHANNELS = 4
"""Of a cell: density or nearness to the surface, red, green, blue. A cell of zeros is empty."""
GREY_CARD = 0.18
"""Reflectance of what is of median luminance in a capture: cameras expose the middle of a scene to it."""
DARKEST = 1e-3
"""Least radiance of white that is taken for granted."""
HEADER = "field"
"""Member with the record and what is no array, as JSON text in bytes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldFile:
    """One field. Its frame is the object's: metres, Z up, front towards -Y, its mesh standing on z = 0 with the
    middle of its box over the origin; `assets.mesh_file` refuses another place.

    Raises UserError for numbers that no field has.
    """

    record: FieldRecord
    mesh: TriangleMesh
    """Taken from the field and cleaned; its colours are what the field shows there, linear, in [0, 1], seen from
    outside along the normal and divided by `white`."""
    centre: tuple[float, float, float]
    """Middle of the ball that the field fills, metres."""
    radius: float
    """Of that ball, metres; the grid spans [-1, 1]^3 of it."""
    white: float = 1.0
    """Radiance of white paper in the light that the images were taken in, which all radiance of the field belongs
    to."""
    grid: np.ndarray | None = None
    """(R, R, R, CHANNELS) float32 by z, y, x: raw values of cells, of which the first is density or distance and the
    next three are colour; None for splats."""
    splats: SplatCloud | None = None
    numbers: dict[str, float] = field(default_factory=dict)
    """What raw values become opacity and colour by; see `rendering.field`."""
    more: dict[str, np.ndarray] = field(default_factory=dict)
    """Other arrays that the field is evaluated with, by name: weights, cells that hold something."""

    def __post_init__(self) -> None:
        figures = {"radius": self.radius, "white": self.white}
        for name, value in figures.items():
            if not 0 < value < float("inf"):
                raise UserError(f"field: {name}: expected a number above 0, got {value}")
        if len(self.centre) != 3 or not np.isfinite(self.centre).all():
            raise UserError(f"field: centre: expected three finite numbers, got {self.centre}")
        if bad := {name: value for name, value in self.numbers.items() if not np.isfinite(value)}:
            raise UserError(f"field: numbers: expected finite ones, got {bad}")
        if self.grid is not None:
            side = len(self.grid)
            if self.grid.shape != (side, side, side, CHANNELS) or self.grid.dtype != np.float32 or side < 2:
                raise UserError(f"field: grid: expected (R, R, R, {CHANNELS}) float32, got {self.grid.shape} "
                                f"{self.grid.dtype}")
            if not np.isfinite(self.grid).all() or "scale" not in self.numbers:
                raise UserError("field: grid: expected finite numbers and their scale, got others")
        colors = self.mesh.colors
        if colors is not None and not ((colors >= 0) & (colors <= 1)).all():
            raise UserError("field: mesh: expected colours in [0, 1], got others")


def white_of_median(median: float) -> float:
    """Radiance of white paper where this is the median luminance of what a capture shows."""
    return max(median / GREY_CARD, DARKEST)


def encode(content: FieldFile) -> bytes:
    """The bytes of a field's file, the same for the same field."""
    arrays = {**{f"mesh.{name}": value for name, value in _arrays(content.mesh).items()},
              **{f"more.{name}": value for name, value in content.more.items()}}
    if content.grid is not None:
        arrays["grid"] = content.grid
    if content.splats is not None:
        arrays |= {f"splats.{name}": value for name, value in _arrays(content.splats).items()}
    # Checksums of the archive do not cover names: a member that goes by another one would be missing without a word
    header = {"format": FORMAT, "record": content.record.model_dump(mode="json"), "centre": content.centre,
              "radius": content.radius, "white": content.white, "numbers": content.numbers,
              "srgb": content.splats is not None and content.splats.srgb, "members": sorted(arrays)}
    arrays = {HEADER: np.frombuffer(json.dumps(header, sort_keys=True).encode(), np.uint8), **arrays}
    stream = BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def write_field(path: Path, content: FieldFile) -> None:
    """Write a field, whole or not at all. Raises OutputError where it cannot be written."""
    write_atomic(path, encode(content))


def read_field(path: Path) -> FieldFile:
    """The field of a file. Raises UserError where there is none, or where it is damaged or of another format."""
    def refused(rule: str, hint: str = "") -> UserError:
        return UserError([Problem(where=str(path), path="", rule=rule, hint=hint)])

    try:
        # From memory: a damaged archive would leave the file open
        data = path.read_bytes()
        if not data.startswith(ZIP):
            raise zipfile.BadZipFile("it is no zip archive")
        with np.load(BytesIO(data), allow_pickle=False) as members:
            return _decoded(members)
    except FileNotFoundError:
        raise refused("expected a field, found no file") from None
    except UNREADABLE as error:
        raise refused(f"expected a whole field of format {FORMAT}, got one that cannot be read: {error}",
                      "make it again") from error


def _arrays(holder: Any) -> dict[str, np.ndarray]:
    found = {each.name: getattr(holder, each.name) for each in fields(holder)}
    return {name: value for name, value in found.items() if isinstance(value, np.ndarray)}


def _decoded(members: Any) -> FieldFile:
    header = json.loads(bytes(members[HEADER]))
    if header["format"] != FORMAT:
        raise ValueError(f"format {header['format']}")
    if sorted(members.files) != sorted([HEADER, *header["members"]]):
        raise ValueError(f"members {', '.join(members.files)}")

    def group(name: str) -> dict[str, np.ndarray]:
        return {key.removeprefix(f"{name}."): members[key] for key in members.files if key.startswith(f"{name}.")}

    splats = group("splats")
    return FieldFile(record=FieldRecord.model_validate(header["record"]), mesh=TriangleMesh(**group("mesh")),
                     centre=tuple(header["centre"]), radius=header["radius"], white=header["white"],
                     grid=members["grid"] if "grid" in members.files else None,
                     splats=SplatCloud(**splats, srgb=header["srgb"]) if splats else None,
                     numbers=header["numbers"], more=group("more"))
