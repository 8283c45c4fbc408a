"""What a build remembers between its runs, beside the staged examples, for as long as the same code would find it."""

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from dataset_builder.digest import digest, sealed, unsealed
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.shards.folder import WORK
from dataset_builder.spec.model import Model

MAKER_DIGITS = 16
Item = TypeVar("Item", bound=Model)


class MakerFile(Generic[Item]):
    """Models of one kind, called `name`, of one output folder, for one spec made by one set of versions: a file of
    their own keeps them from every other."""

    def __init__(self, folder: Path, name: str, kind: type[Item], spec_digest: str, made_by: Mapping[str, str]):
        self._name, self._kind = name, kind
        self._maker = digest({"spec": spec_digest, "versions": dict(made_by)})
        self._path = folder / WORK / f"{name}.{self._maker[:MAKER_DIGITS]}.json"

    def read(self) -> tuple[Item, ...]:
        """What was written last; nothing where nothing was, or it is damaged or of another maker."""
        try:
            content = unsealed(self._path.read_bytes())
        except FileNotFoundError:
            return ()
        if content is None or content["maker"] != self._maker:
            return ()
        return self._items(content)

    def write(self, items: Iterable[Item]) -> None:
        """Replace it. Raises OutputError where it cannot be written."""
        write_atomic(self._path, self._sealed(items))

    def journal(self) -> Iterator[Item]:
        """What was appended, in order. A line that is damaged, or was cut short as the machine stopped, is passed
        over."""
        try:
            lines = self._journal.read_bytes().split(b"\n")
        except FileNotFoundError:
            return
        for line in lines:
            content = unsealed(line)
            if content is not None and content["maker"] == self._maker:
                yield from self._items(content)

    def append(self, items: Iterable[Item]) -> None:
        """Add a line to the journal, which lies beside what `write` keeps: what is there already is neither read nor
        written again. Raises OutputError where it cannot be written."""
        with output_errors(self._journal):
            self._journal.parent.mkdir(parents=True, exist_ok=True)
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW
            with open(os.open(self._journal, flags, 0o666), "ab") as stream:
                # The line before it may have been cut short
                stream.write(b"\n" + self._sealed(items))
                stream.flush()
                os.fsync(stream.fileno())

    @property
    def _journal(self) -> Path:
        return self._path.with_suffix(".jsonl")

    def _sealed(self, items: Iterable[Item]) -> bytes:
        return sealed({"maker": self._maker, self._name: [item.model_dump(mode="json") for item in items]})

    def _items(self, content: Mapping[str, Any]) -> tuple[Item, ...]:
        return tuple(self._kind.model_validate(item) for item in content[self._name])
