"""A composed frame as files: linear for further work, tone-mapped for viewing, and its parts."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dataset_builder.files import write_atomic
from dataset_builder.lightnet.results.compose import Composite
from dataset_builder.report.example_sheet import SheetRow, png_of, write_sheet
from dataset_builder.shards.exr import encode_picture

LINEAR, PREVIEW, SIDES = "composite.exr", "composite.png", "side_by_side.png"
RESULT = "I_R"
"""Heading of the composed frame."""
CELL = 320


def write_composite(composite: Composite, panels: Mapping[str, np.ndarray], out: Path, *, title: str) -> list[Path]:
    """Write the frame as EXR and as PNG, and all panels side by side; the paths. Raises OutputError."""
    write_atomic(out / LINEAR, encode_picture(composite.picture, name="composite"))
    write_atomic(out / PREVIEW, png_of(panels[RESULT]))
    lines = [*_wrapped(title), f"{composite.predicted.sum()} pixels predicted", f"{composite.filled.sum()} filled",
             f"exposure {composite.exposure:.4g}"]
    write_sheet([SheetRow(lines=lines, panels=panels)], out / SIDES, cell=CELL)
    return [out / LINEAR, out / PREVIEW, out / SIDES]


def _wrapped(title: str) -> list[str]:
    """A path with its example on lines of their own, the end of each being what tells it from others."""
    return [part[-28:] for part in title.split(", ")]
