"""What is noted of outcomes between the runs of a build: which examples failed a gate, and how long each took."""

import csv
from collections.abc import Container, Iterable, Sequence
from io import StringIO
from pathlib import Path

from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.engine.maker_file import MakerFile
from dataset_builder.engine.rejected_pixels import PICTURES, pictures
from dataset_builder.engine.unit import Outcome
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.shards.folder import SECONDS, next_of
from dataset_builder.shards.manifest import Rejected

HEADER = ("key", "step", "seconds")
KEY_DIGITS = 8
"""Of a field's key, enough to tell several fields of an object apart."""


class Rejections:
    """The rejected examples of one output folder, for one spec made by one set of versions, so that a resumed build
    neither forgets nor repeats them."""

    def __init__(self, folder: Path, spec_digest: str, made_by: dict[str, str]):
        self._file = MakerFile(folder, PICTURES, Rejected, spec_digest, made_by)
        self.known: dict[str, Rejected] = {item.key: item for item in self._file.read()}
        with output_errors(folder):
            for path in pictures(folder):
                if path.name.partition(".")[0] not in self.known:
                    path.unlink()

    def add(self, rejected: Sequence[Rejected]) -> None:
        """Remember some. Raises OutputError where they cannot be written."""
        if rejected:
            self.known |= {item.key: item for item in rejected}
            self._file.write(self.known.values())


class Timings:
    """Seconds by example and step: `plan`, a pass, `denoise`, `encode`, in a file beside the dataset; and by object,
    those of the images of its field and of the fit.

    They depend on the machine and the day, and would make two builds of the same dataset differ, so no shard holds
    them. What a step made for several examples of a view counts for the first of them. An earlier run's figures stay
    where nothing was rendered again. The file waits for the dataset to be published.
    """

    def __init__(self, folder: Path):
        self._path = next_of(folder) / SECONDS
        self._known = _load(self._path if self._path.is_file() else folder / SECONDS)

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """Take the figures of what was rendered."""
        for outcome in outcomes:
            if outcome.seconds and not outcome.kept:
                self._known = {pair: value for pair, value in self._known.items() if pair[0] != outcome.ref.key}
                self._known |= {(outcome.ref.key, step): f"{value:.4f}" for step, value in outcome.seconds.items()}

    def add_field(self, news: FieldNews) -> None:
        """Take the figures of a field that was made; an object may have several."""
        step = f"{news.kind} {news.key[:KEY_DIGITS]}"
        self._known |= {(news.object, f"{name} of {step}"): f"{value:.4f}" for name, value in news.seconds.items()}

    def take(self, folder: Path, keys: Container[str]) -> None:
        """Take the figures that another folder has of examples with some keys, and of fields."""
        self._known |= {(key, step): value for (key, step), value in Timings(folder)._known.items()
                        if key in keys or " of " in step}

    def write(self) -> None:
        """Write all of them, by key. Raises OutputError where that cannot be done."""
        text = StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(HEADER)
        rows.writerows((key, step, value) for (key, step), value in sorted(self._known.items()))
        write_atomic(self._path, text.getvalue().encode())


def _load(path: Path) -> dict[tuple[str, str], str]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (FileNotFoundError, UnicodeDecodeError):
        return {}
    return {(row[0], row[1]): row[2] for row in csv.reader(lines[1:]) if len(row) == len(HEADER)}
