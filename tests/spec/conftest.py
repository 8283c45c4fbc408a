"""A small dataset in a folder of its own, whose files tests change one at a time."""

from pathlib import Path
from typing import Protocol

import pytest

FILES = {
    "tiny.yaml": """\
name: tiny
seed: 3
rough: {sigma: 0.01}
splits:
  - name: train
    objects: {count: 2, from: [objects/chair.yaml, objects/stool.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
  - name: test
    objects: {count: 1, from: [objects/stool.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
""",
    "objects/chair.yaml": "family: chair\nparams:\n  width: {uniform: [0.42, 0.5]}\n",
    "objects/stool.yaml": "family: stool\n",
    "rooms/den.yaml": "width: 4\ndepth: 3.5\n",
    "scenes/den.yaml": "room: ../rooms/den.yaml\nfurniture:\n  - {object: ../objects/stool.yaml, place: near}\n",
}


class Writer(Protocol):
    """Writes the small dataset with some files replaced; gives the path of its dataset file."""

    def __call__(self, **changed: str | bytes) -> Path: ...


@pytest.fixture
def tiny(tmp_path: Path) -> Writer:
    """Keyword arguments replace files: `tiny(**{"rooms/den.yaml": "width: 5"})`."""

    def write(**changed: str | bytes) -> Path:
        for name, content in {**FILES, **changed}.items():
            file = tmp_path / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content if isinstance(content, bytes) else content.encode())
        return tmp_path / "tiny.yaml"

    return write


@pytest.fixture
def in_folder(tiny: Writer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Writer:
    """As `tiny`, from within the folder, so that messages name files as short as a user types them."""
    monkeypatch.chdir(tmp_path)
    return lambda **changed: tiny(**changed).relative_to(tmp_path)
