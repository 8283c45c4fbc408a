"""A file of splats -> the field of an object."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.splat_file import read_splats
from dataset_builder.digest import digest, sha256_file
from dataset_builder.errors import UserError
from dataset_builder.rendering.field.splat_field import SplatStance, field_of_splats


@dataclass(frozen=True, kw_only=True, eq=False)
class CapturedSplats:
    """What became of a file."""

    field: FieldFile
    read: int
    """Splats of the file that can be drawn; `field.splats` holds those that were taken."""
    notes: tuple[str, ...]
    """What is to be said of the file, see `SplatFile`, and of the crop."""


def captured_splats(path: Path, stance: SplatStance, *, srgb: bool | None = None, white: float = 1.0) -> CapturedSplats:
    """The field of an object out of a file of splats, keyed by the file's bytes and all that was asked for.

    srgb: whether colours are sRGB-encoded, where that is known better than the file says. Mitsuba's variant is set.
    Raises UserError where the file cannot be read, or holds no such object.
    """
    found = read_splats(path, srgb=srgb)
    asked = {"sha256": sha256_file(path), "stance": asdict(stance), "srgb": srgb, "white": white}
    try:
        field = field_of_splats(found.cloud, stance, key=digest(asked), white=white)
    except UserError as error:
        refuse(path, str(error))
    assert field.splats is not None
    left = len(found.cloud) - len(field.splats)
    told = [f"{left:,} of {len(found.cloud):,} splats lie outside of the crop, or apart from the largest body"] * (left > 0)
    return CapturedSplats(field=field, read=len(found.cloud), notes=(*found.notes, *told))
