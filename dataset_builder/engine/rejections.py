"""Examples that failed a gate, remembered, so that a resumed build neither forgets nor repeats them."""

from pathlib import Path

from dataset_builder.engine.maker_file import MakerFile
from dataset_builder.engine.rejected_pixels import PICTURES, pictures
from dataset_builder.files import output_errors
from dataset_builder.shards.manifest import Rejected


class Rejections:
    """The rejected examples of one output folder, for one spec made by one set of versions."""

    def __init__(self, folder: Path, spec_digest: str, made_by: dict[str, str]):
        self._file = MakerFile(folder, PICTURES, Rejected, spec_digest, made_by)
        self.known: dict[str, Rejected] = {item.key: item for item in self._file.read()}
        with output_errors(folder):
            for path in pictures(folder):
                if path.name.partition(".")[0] not in self.known:
                    path.unlink()

    def add(self, rejected: Rejected) -> None:
        """Remember one. Raises OutputError where it cannot be written."""
        self.known[rejected.key] = rejected
        self._file.write(self.known.values())
