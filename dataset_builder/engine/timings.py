"""Seconds that every example took, kept beside the dataset: they depend on the machine and the day, and would make two
builds of the same dataset differ, so no shard holds them.
"""

import csv
from collections.abc import Iterable
from io import StringIO
from pathlib import Path

from dataset_builder.engine.unit import Outcome
from dataset_builder.files import write_atomic
from dataset_builder.shards.folder import SECONDS, next_of

HEADER = ("key", "step", "seconds")


class Timings:
    """Seconds by example and step: `plan`, a pass, `denoise`, `encode`. What a step made for several examples of a
    view counts for the first of them. An earlier run's figures stay where nothing was rendered again. The file waits
    for the dataset to be published."""

    def __init__(self, folder: Path):
        self._path = next_of(folder) / SECONDS
        self._known = _load(self._path if self._path.is_file() else folder / SECONDS)

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """Take the figures of what was rendered."""
        for outcome in outcomes:
            if outcome.seconds and not outcome.kept:
                self._known = {pair: value for pair, value in self._known.items() if pair[0] != outcome.ref.key}
                self._known |= {(outcome.ref.key, step): f"{value:.4f}" for step, value in outcome.seconds.items()}

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
