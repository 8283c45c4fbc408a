"""Images of a field in the making, kept on the disk as they are taken, so that an interrupted making goes on from
there."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from zlib import crc32

import numpy as np

from dataset_builder.digest import sealed, unsealed
from dataset_builder.files import flush_folder, output_errors, require_space, write_atomic

PIXELS, SUMS = "images.npy", "images.json"
OFTEN = 16
"""Images after which what was taken is flushed to the disk and noted."""


class KeptImages:
    """N images (H, W, 4) float16 in a folder of their own, with the checksum of each that is there.

    What does not have the checksum that was noted, be it that the machine stopped, is missing. Raises OutputError where
    the disk refuses, or has no room.
    """

    def __init__(self, folder: Path, count: int, size: int):
        self._folder = folder
        shape = (count, size, size, 4)
        with output_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            self.pixels = _opened(folder / PIXELS, shape)
        self._sums = self._known()

    def missing(self) -> list[int]:
        """Numbers of the images that are to be taken."""
        return [number for number in range(len(self.pixels)) if number not in self._sums]

    def keep(self, taken: Iterable[tuple[int, np.ndarray]]) -> Iterator[int]:
        """Keep images by number as they come; yields how many there are after each."""
        try:
            for count, (number, image) in enumerate(taken, 1):
                self.pixels[number] = image
                self._sums[number] = _sum(self.pixels[number])
                if count % OFTEN == 0:
                    self._note()
                yield len(self._sums)
        finally:
            self._note()

    def _note(self) -> None:
        with output_errors(self._folder):
            self.pixels.flush()
        write_atomic(self._folder / SUMS, sealed({"sums": {str(k): value for k, value in self._sums.items()}}))

    def _known(self) -> dict[int, int]:
        content = None
        with suppress(OSError):
            content = unsealed((self._folder / SUMS).read_bytes())
        sums = {int(number): value for number, value in (content or {"sums": {}})["sums"].items()}
        return {number: value for number, value in sums.items()
                if 0 <= number < len(self.pixels) and _sum(self.pixels[number]) == value}


def _opened(path: Path, shape: tuple[int, ...]) -> np.memmap:
    """The file of all images, made anew where it is not of this shape."""
    with suppress(OSError, ValueError):
        found = np.lib.format.open_memmap(path, mode="r+")
        if found.shape == shape and found.dtype == np.float16:
            return found
    require_space(path.parent, int(np.prod(shape)) * 2)
    (path.parent / SUMS).unlink(missing_ok=True)
    made = np.lib.format.open_memmap(path, mode="w+", dtype=np.float16, shape=shape)
    made.flush()
    flush_folder(path.parent)
    return made


def _sum(image: np.ndarray) -> int:
    return crc32(np.ascontiguousarray(image).data)
