"""Examples that failed a gate, remembered beside the staged ones, so that a resumed build neither forgets nor repeats
them."""

import json
from pathlib import Path

from dataset_builder.digest import canonical_json, digest
from dataset_builder.files import write_atomic
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.manifest import Rejected

FILE = "rejected.{maker}.json"
MAKER_DIGITS = 16


class Rejections:
    """The rejected examples of one output folder, for one spec made by one set of versions; a file of their own keeps
    them from every other."""

    def __init__(self, folder: Path, spec_digest: str, made_by: dict[str, str]):
        self._maker = digest({"spec": spec_digest, "versions": made_by})
        self._path = folder / WORK / FILE.format(maker=self._maker[:MAKER_DIGITS])
        self.known: dict[str, Rejected] = self._load()

    def add(self, rejected: Rejected) -> None:
        """Remember one. Raises OutputError where it cannot be written."""
        self.known[rejected.key] = rejected
        plain = [item.model_dump(mode="json") for item in self.known.values()]
        write_atomic(self._path, canonical_json({"maker": self._maker, "rejected": plain}))

    def _load(self) -> dict[str, Rejected]:
        try:
            content = json.loads(self._path.read_bytes())
        except (FileNotFoundError, ValueError):
            return {}
        if not isinstance(content, dict) or content.get("maker") != self._maker:
            return {}
        return {item["key"]: Rejected.model_validate(item) for item in content["rejected"]}
