"""A file of splats -> the field of an object."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.field_file import GREY_CARD, FieldFile, white_of_median
from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.splat_file import read_splats
from dataset_builder.digest import digest, sha256_file
from dataset_builder.errors import UserError
from dataset_builder.rendering.field.splat_field import CELLS, SplatStance, field_of_splats
from dataset_builder.tonemap import luminance


@dataclass(frozen=True, kw_only=True, eq=False)
class CapturedSplats:
    """What became of a file."""

    field: FieldFile
    notes: tuple[str, ...]
    """What is to be said of the file, see `SplatFile`, of the crop and of the light."""


def captured_splats(path: Path, stance: SplatStance, *, srgb: bool | None = None, white: float | None = None,
                    cells: int = CELLS) -> CapturedSplats:
    """The field of an object out of a file of splats, keyed by the file's bytes and all that was asked for.

    srgb: whether colours are sRGB-encoded, where that is known better than the file says. white: radiance of white
    paper in the light of the capture; None takes the median luminance of the mesh's colours for a reflectance of
    `GREY_CARD`. Mitsuba's variant is set. Raises UserError where the file cannot be read, or holds no such object.
    """
    found = read_splats(path, srgb=srgb)
    asked = {"sha256": sha256_file(path), "stance": asdict(stance), "srgb": srgb, "white": white, "cells": cells}
    try:
        field = field_of_splats(found.cloud, stance, key=digest(asked), white=1.0 if white is None else white,
                                cells=cells)
    except UserError as error:
        refuse(path, str(error))
    assert field.splats is not None and field.mesh.colors is not None
    notes, left = list(found.notes), len(found.cloud) - len(field.splats)
    if left:
        notes.append(f"{left:,} of {len(found.cloud):,} splats lie outside of the crop, or apart from its largest body")
    if white is None:
        median = float(np.median(luminance(field.mesh.colors[..., :3])))
        paper = white_of_median(median)
        colours = np.append(np.clip(field.mesh.colors[..., :3] / paper, 0, 1), field.mesh.colors[..., 3:], axis=-1)
        field = replace(field, white=paper, mesh=replace(field.mesh, colors=colours))
        notes.append(f"white of the capture is taken to be {paper:.3g}: the median luminance of the object, "
                     f"{median:.3g}, is taken for a reflectance of {GREY_CARD}")
    return CapturedSplats(field=field, notes=tuple(notes))
