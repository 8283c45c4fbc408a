"""What a build remembers between its runs, beside the staged examples, for as long as the same code would find it."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Generic, TypeVar

from dataset_builder.digest import digest, sealed, unsealed
from dataset_builder.files import write_atomic
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
        return tuple(self._kind.model_validate(item) for item in content[self._name])

    def write(self, items: Iterable[Item]) -> None:
        """Replace it. Raises OutputError where it cannot be written."""
        plain = [item.model_dump(mode="json") for item in items]
        write_atomic(self._path, sealed({"maker": self._maker, self._name: plain}))
