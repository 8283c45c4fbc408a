"""Examples that failed a gate, remembered, so that a resumed build neither forgets nor repeats them; the pixels of the
first few are kept to be looked at."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np

from dataset_builder.engine.maker_file import MakerFile
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.shards.example import preview
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.manifest import Rejected

PICTURES = "rejected"
MOST_PICTURES = 32


class Rejections:
    """The rejected examples of one output folder, for one spec made by one set of versions."""

    def __init__(self, folder: Path, spec_digest: str, made_by: dict[str, str]):
        self._file = MakerFile(folder, PICTURES, Rejected, spec_digest, made_by)
        self.known: dict[str, Rejected] = {item.key: item for item in self._file.read()}
        with output_errors(folder):
            for path in _pictures(folder):
                if path.name.partition(".")[0] not in self.known:
                    path.unlink()

    def add(self, rejected: Rejected) -> None:
        """Remember one. Raises OutputError where it cannot be written."""
        self.known[rejected.key] = rejected
        self._file.write(self.known.values())


def keep_pixels(folder: Path, key: str, layers: Mapping[str, np.ndarray]) -> None:
    """Keep the layers of a rejected example as `.build/rejected/<key>.npz`, float32, and a picture of them beside it,
    of the first `MOST_PICTURES` examples of a build. Raises OutputError where they cannot be written."""
    path = folder / WORK / PICTURES / f"{key}.npz"
    if len([other for other in _pictures(folder) if other.suffix == path.suffix and other != path]) < MOST_PICTURES:
        stream = BytesIO()
        np.savez_compressed(stream, **layers)  # type: ignore[arg-type]
        write_atomic(path, stream.getvalue())
        finite = {name: np.nan_to_num(image) for name, image in layers.items()}
        write_atomic(path.with_suffix(".png"), preview(finite))


def pixels_of(folder: Path, key: str) -> Path | None:
    """Where the layers of a rejected example lie; None where they were not kept."""
    path = folder / WORK / PICTURES / f"{key}.npz"
    return path if path.is_file() else None


def _pictures(folder: Path) -> list[Path]:
    return sorted((folder / WORK / PICTURES).glob("*.*"))
