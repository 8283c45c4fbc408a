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
    if _wanted(folder, key):
        stream = BytesIO()
        np.savez_compressed(stream, **layers)  # type: ignore[arg-type]
        keep_file(folder, f"{key}.npz", stream.getvalue())
        finite = {name: np.nan_to_num(image) for name, image in layers.items()}
        keep_file(folder, f"{key}.png", preview(finite))


def keep_file(folder: Path, name: str, data: bytes) -> None:
    """Keep a file that was kept elsewhere, of the first `MAX_PICTURES` examples. Raises OutputError."""
    if _wanted(folder, name.partition(".")[0]):
        write_atomic(folder / WORK / PICTURES / name, data)


def take_pixels(folder: Path, source: Path, key: str) -> None:
    """Keep what another folder kept of a rejected example, of the first `MAX_PICTURES`. Raises OutputError."""
    for path in (source / WORK / PICTURES / f"{key}{suffix}" for suffix in (".npz", ".png")):
        if path.is_file():
            with output_errors(path):
                data = path.read_bytes()
            keep_file(folder, path.name, data)


def _wanted(folder: Path, key: str) -> bool:
    """Whether few others are kept."""
    others = {path.stem for path in pictures(folder) if path.suffix == ".npz"} - {key}
    return len(others) < MAX_PICTURES


def pixels_of(folder: Path, key: str) -> Path | None:
    """Where the layers of a rejected example lie; None where they were not kept."""
    path = folder / WORK / PICTURES / f"{key}.npz"
    return path if path.is_file() else None


def pictures(folder: Path) -> list[Path]:
    """Every file that is kept."""
    return sorted((folder / WORK / PICTURES).glob("*.*"))
