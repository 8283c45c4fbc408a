"""Pixels of the first few examples that failed a gate, kept to be looked at."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np

from dataset_builder.files import output_errors, write_atomic
from dataset_builder.shards.example import preview
from dataset_builder.shards.folder import WORK

PICTURES = "rejected"
MAX_PICTURES = 32


def keep_pixels(folder: Path, key: str, layers: Mapping[str, np.ndarray]) -> None:
    """Keep the layers of a rejected example as `.build/rejected/<key>.npz`, float32, and a picture of them beside it,
    of the first `MAX_PICTURES` examples of a build. Raises OutputError where they cannot be written."""
    path = folder / WORK / PICTURES / f"{key}.npz"
    if len([other for other in pictures(folder) if other.suffix == path.suffix and other != path]) < MAX_PICTURES:
        stream = BytesIO()
        np.savez_compressed(stream, **layers)  # type: ignore[arg-type]
        write_atomic(path, stream.getvalue())
        finite = {name: np.nan_to_num(image) for name, image in layers.items()}
        write_atomic(path.with_suffix(".png"), preview(finite))


def take_pixels(folder: Path, source: Path, key: str) -> None:
    """Keep what another folder kept of a rejected example, of the first `MAX_PICTURES`. Raises OutputError."""
    there = len([path for path in pictures(folder) if path.suffix == ".npz"])
    for path in (source / WORK / PICTURES / f"{key}{suffix}" for suffix in (".npz", ".png")):
        if there < MAX_PICTURES and path.is_file():
            with output_errors(path):
                data = path.read_bytes()
            write_atomic(folder / WORK / PICTURES / path.name, data)


def pixels_of(folder: Path, key: str) -> Path | None:
    """Where the layers of a rejected example lie; None where they were not kept."""
    path = folder / WORK / PICTURES / f"{key}.npz"
    return path if path.is_file() else None


def pictures(folder: Path) -> list[Path]:
    """Every file that is kept."""
    return sorted((folder / WORK / PICTURES).glob("*.*"))
