"""A dataset to travel, and a place that counts what is asked of it and can be made to fail."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from dataset_builder.remote.place import ByteRange, FolderPlace
from dataset_builder.shards.example import Example
from tests.shards.tiny_dataset import Shared, build, make_example

LEVELS = ("fine", "coarse")
SHARDS = {("train", 0): (0, 1, 2), ("train", 1): (3, 4, 5), ("train", 2): (6, 7), ("test", 0): (8, 9, 10),
          ("test", 1): (11,)}
Change = Callable[[str, int, bytes], bytes]


def examples() -> dict[int, Example]:
    """Twelve examples: views of two lights, objects and levels that take turns."""
    return {index: _example(index, "train" if index < 8 else "test") for index in range(12)}


def _example(index: int, split: str) -> Example:
    plain = make_example(index, split=split, view=f"{split}/{index // 2:06d}", light=index % 2)
    level, kind = index // 2 % 2, ("stool", "chair", "lamp")[index // 2 % 3]
    thing = plain.plan.target.object.model_copy(update={"name": f"{split}-{kind}-{index // 4:02d}", "category": kind})
    plan = plain.plan.model_copy(update={
        "target": plain.plan.target.model_copy(update={"object": thing}),
        "room": plain.plan.room.model_copy(update={"name": f"{split}-room-{index // 6:02d}"}),
        "rough": plain.plan.rough.model_copy(update={"level": level, "name": LEVELS[level]})})
    return replace(plain, plan=plan)


@pytest.fixture(scope="session")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished dataset of twelve examples; not to be changed."""
    return made(tmp_path_factory.mktemp("home") / "tiny")


@pytest.fixture(scope="session")
def shared_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same, with equal pixels of a view stored once; not to be changed."""
    return made(tmp_path_factory.mktemp("shared") / "tiny", "once")


def made(folder: Path, shared: Shared = "each", chosen: dict[int, Example] | None = None) -> Path:
    """The dataset, built into a folder."""
    build(folder, chosen or examples(), shards=SHARDS, shared=shared)
    return folder


@dataclass
class CountingPlace:
    """A folder as a place. `change` may give other bytes of (file, start, bytes), or raise."""

    folder: Path
    change: Change = lambda name, start, data: data
    log: list[ByteRange] = field(default_factory=list)
    title: str = "https://example.org/tiny"

    def size(self, name: str) -> int:
        return FolderPlace(self.folder).size(name)

    def read(self, name: str, *, most: int) -> bytes:
        data = FolderPlace(self.folder).read(name, most=most)
        self.log.append(ByteRange(name, 0, len(data)))
        return self.change(name, 0, data)

    def ranges(self, wanted: Sequence[ByteRange]) -> list[bytes]:
        self.log += wanted
        found = FolderPlace(self.folder).ranges(wanted)
        return [self.change(piece.name, piece.start, data) for piece, data in zip(wanted, found, strict=True)]

    def stream(self, name: str, *, start: int = 0) -> Iterator[bytes]:
        return FolderPlace(self.folder).stream(name, start=start)

    def fetched(self, suffix: str = "") -> int:
        """Bytes asked for of files whose names end so."""
        return sum(piece.size for piece in self.log if piece.name.endswith(suffix))


@pytest.fixture
def place(home: Path) -> CountingPlace:
    """The dataset as a place."""
    return CountingPlace(home)
