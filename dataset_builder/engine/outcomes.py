"""What is noted of outcomes between the runs of a build: which examples failed a gate, and how long each took."""

import csv
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from io import StringIO
from itertools import groupby
from pathlib import Path

from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.engine.maker_file import MakerFile
from dataset_builder.engine.rejected_pixels import PICTURES, pictures
from dataset_builder.engine.unit import Outcome
from dataset_builder.files import commit, output_errors, write_partial
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
        self.known: dict[str, Rejected] = {item.key: item for item in self._file.journal()}
        with output_errors(folder):
            for path in pictures(folder):
                if path.name.partition(".")[0] not in self.known:
                    path.unlink()

    def add(self, rejected: Sequence[Rejected]) -> None:
        """Remember some. Raises OutputError where they cannot be written."""
        if rejected:
            self.known |= {item.key: item for item in rejected}
            self._file.append(rejected)


class Timings:
    """Seconds by example and step: `plan`, a pass, `denoise`, `encode`, in a file beside the dataset; and by object,
    those of the images of its field and of the fit.

    They depend on the machine and the day, and would make two builds of the same dataset differ, so no shard holds
    them. What a step made for several examples of a view counts for the first of them. An earlier run's figures stay
    where nothing was rendered again. The file waits for the dataset to be published.

    Of each example there is one string, its rows: a million examples are a few hundred megabytes.
    """

    def __init__(self, folder: Path):
        self._path = next_of(folder) / SECONDS
        self._known = _load(self._path if self._path.is_file() else folder / SECONDS)

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """Take the figures of what was rendered."""
        for outcome in outcomes:
            if outcome.seconds and not outcome.kept:
                self._known[outcome.ref.key] = _rows(outcome.ref.key, _written(outcome.seconds))

    def add_field(self, news: FieldNews) -> None:
        """Take the figures of a field that was made; an object may have several."""
        step = f"{news.kind} {news.key[:KEY_DIGITS]}"
        others = {row[1]: row[2] for row in csv.reader(self._known.get(news.object, "").splitlines())}
        seconds = {f"{name} of {step}": value for name, value in _written(news.seconds).items()}
        self._known[news.object] = _rows(news.object, others | seconds)

    def take(self, folder: Path, keys: Container[str]) -> None:
        """Take the figures that another folder has of examples with some keys, and of fields."""
        self._known |= {key: rows for key, rows in Timings(folder)._known.items() if key in keys or not key.isdecimal()}

    def write(self) -> None:
        """Write all of them, by key. Raises OutputError where that cannot be done."""
        lines = (self._known[key].encode() for key in sorted(self._known))
        write_partial(self._path, [f"{','.join(HEADER)}\n".encode(), *lines])
        commit(self._path)


def _written(seconds: Mapping[str, float]) -> dict[str, str]:
    return {step: f"{value:.4f}" for step, value in seconds.items()}


def _rows(key: str, seconds: Mapping[str, str]) -> str:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows((key, step, seconds[step]) for step in sorted(seconds))
    return text.getvalue()


def _load(path: Path) -> dict[str, str]:
    """Rows of each key; those of a key are neighbours."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            found = [row for row in csv.reader(stream) if len(row) == len(HEADER) and tuple(row) != HEADER]
    except (FileNotFoundError, UnicodeDecodeError):
        return {}
    return {key: _rows(key, {row[1]: row[2] for row in rows})
            for key, rows in groupby(found, key=lambda row: row[0])}


class Tally:
    """Sums over the outcomes of a build, which may be millions."""

    def __init__(self) -> None:
        self.examples = self.paths = self.recalled = 0
        self.rejected: list[Rejected] = []
        self.seconds = Counter[str]()
        """By pass and by step, over all processes."""
        self.runs = Counter[str]()
        """How often each of them was."""

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """Count some."""
        for outcome in outcomes:
            self.examples, self.paths = self.examples + 1, self.paths + outcome.paths
            self.recalled += len(outcome.recalled)
            self.seconds.update(outcome.seconds)
            self.runs.update(outcome.seconds.keys())
            if outcome.rejected:
                self.rejected.append(outcome.rejected)
