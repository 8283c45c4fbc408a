"""Splats of a PLY file as trainers write it: Kerbl and others (2023), gsplat, nerfstudio, Postshot, SuperSplat.

Scales are logarithms, opacities are logits, quaternions are w x y z and of any length, and of the higher harmonics come
first those of red, then of green, then of blue.
"""

import re
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers.ply_tables import Table, ply_tables
from dataset_builder.assets.readers.polygon_checks import content_of
from dataset_builder.assets.readers.splat_columns import SplatFile, check_count, check_harmonics, checked_cloud
from dataset_builder.digest import open_regular
from dataset_builder.spec.file_reference import MOST_BYTES
from dataset_builder.spec.ply_references import MOST_HEADER, PlyHeader, ply_header

TAKEN = re.compile(r"[xyz]|n[xyz]|f_dc_\d|f_rest_\d+|opacity|scale_[012]|rot_[0123]")
"""Columns that are read, and normals, which trainers write as zeros."""
FLAT = -20.0
"""Logarithm of the third scale of splats that have two."""


def read(path: Path) -> SplatFile:
    """All splats of the element `vertex`, colours taken as sRGB. Raises UserError where the file breaks the format, is
    cut short, holds something else, or has too many."""
    header = _header(path)
    if any(each.name == "vertex" and any(p.name == "packed_position" for p in each.properties)
           for each in header.elements):
        refuse(path, "expected splats with a column for each number, got PlayCanvas's compressed form",
               "write it as an ordinary .ply, with SuperSplat or splat-transform")
    check_count(path, next((each.count for each in header.elements if each.name == "vertex"), 0))
    tables = ply_tables(path, content_of(path), header)
    vertex = tables.get("vertex", {})
    rest = sum(name.startswith("f_rest_") for name in vertex)
    if rest % 3:
        refuse(path, f"expected three channels of harmonics, got {rest} columns f_rest_")
    check_harmonics(path, rest // 3 + 1, "f_rest")
    third = "scale_2" in vertex
    scales = _columns(path, vertex, "scale_", 3 if third else 2)
    dc, higher = _columns(path, vertex, "f_dc_", 3), _columns(path, vertex, "f_rest_", rest)
    harmonics = np.concatenate([dc[:, None], higher.reshape(len(dc), 3, rest // 3).transpose(0, 2, 1)], axis=1)
    others = sorted({*tables} - {"vertex"})
    spare = sorted(name for name in vertex if not TAKEN.fullmatch(name))
    notes = [*([f"elements {', '.join(others)}, not taken"] if others else []),
             *([f"columns {', '.join(spare)}, not taken"] if spare else []),
             *([] if third else ["splats of two scales, which are flat"])]
    with np.errstate(all="ignore"):
        if not third:
            scales = np.concatenate([scales, np.full((len(scales), 1), FLAT, np.float32)], axis=1)
        opacities = 1 / (1 + np.exp(-_column(path, vertex, "opacity").astype(np.float64)))
        return checked_cloud(path, centres=_columns(path, vertex, ("x", "y", "z"), 3), scales=np.exp(scales),
                             turns=_columns(path, vertex, "rot_", 4), opacities=opacities, harmonics=harmonics,
                             srgb=True, notes=tuple(notes))


def _header(path: Path) -> PlyHeader:
    try:
        with open_regular(path, most=MOST_BYTES) as stream:
            return ply_header(stream.read(MOST_HEADER))
    except OSError as error:
        refuse(path, f"expected a readable file, got: {error.strerror}")
    except ValueError as error:
        refuse(path, f"expected a PLY file, got: {error}")


def _columns(path: Path, table: Table, names: str | tuple[str, ...], count: int) -> np.ndarray:
    """(N, count) float32 of columns that are called `names` and a number, or one each of `names`."""
    chosen = names if isinstance(names, tuple) else tuple(f"{names}{k}" for k in range(count))
    rows = len(next(iter(table.values()))) if table else 0  # type: ignore[arg-type]
    found = np.empty((rows, count), np.float32)
    with np.errstate(all="ignore"):
        for number, name in enumerate(chosen):
            found[:, number] = _column(path, table, name)
    return found


def _column(path: Path, table: Table, name: str) -> np.ndarray:
    column = table.get(name)
    if not isinstance(column, np.ndarray):
        known = [each for each in table if not each.startswith("f_rest_")]
        refuse(path, f"expected Gaussian splats with a column {name}, got the columns {', '.join(known) or 'none'}")
    return column
