"""A damaged dataset is mended from a whole copy to the same bytes, fetching no more than is broken, or not at all."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import OutputError, ShardError
from dataset_builder.remote.place import ByteRange, FolderPlace
from dataset_builder.shards.manifest import from_json
from dataset_builder.shards.one_writer import one_writer
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.verify import verify
from dataset_builder.transfer.refetch import repair_from
from tests.shards.tiny_dataset import build, contents, default_examples, index_path, make_example, shard_path

STEM, OTHER = "tiny-v1-train-000000", "tiny-v1-test-000000"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset; not to be changed."""
    folder = tmp_path_factory.mktemp("whole") / "tiny"
    build(folder)
    return folder


@pytest.fixture
def broken(whole: Path, tmp_path: Path) -> Path:
    """A copy to damage, as it was downloaded: without the builder's folder."""
    shutil.copytree(whole, tmp_path / "tiny", ignore=shutil.ignore_patterns(".build"))
    return tmp_path / "tiny"


@dataclass(frozen=True)
class Counting(FolderPlace):
    """A place that counts what is asked of it."""

    asked: list[str] = field(default_factory=list)

    def ranges(self, wanted: Sequence[ByteRange]) -> list[bytes]:
        self.asked.extend(f"{piece.size} of {piece.name}" for piece in wanted)
        return super().ranges(wanted)


def flip(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:1024])


DAMAGE: dict[str, Callable[[Path], None]] = {
    "no dataset.json": lambda folder: (folder / "dataset.json").unlink(),
    "another dataset.json": lambda folder: flip(folder / "dataset.json", 200),
    "no sums": lambda folder: (folder / "SHA256SUMS").unlink(),
    "a line of the sums": lambda folder: flip(folder / "SHA256SUMS", 3),
    "the line of dataset.json": lambda folder: flip(
        folder / "SHA256SUMS", (folder / "SHA256SUMS").read_bytes().index(b"  dataset.json") - 5),
    "no card": lambda folder: (folder / "README.md").unlink(),
    "another catalogue": lambda folder: (folder / "croissant.json").write_text("{"),
    "no index": lambda folder: index_path(folder, STEM).unlink(),
    "an index and its shard": lambda folder: [flip(of(folder, STEM), 700) for of in (index_path, shard_path)] and None,
    "no shard": lambda folder: shard_path(folder, STEM).unlink(),
    "a shard cut short": lambda folder: cut(shard_path(folder, STEM)),
    "a header": lambda folder: flip(shard_path(folder, STEM), 100),
    "the end": lambda folder: flip(shard_path(folder, STEM), shard_path(folder, STEM).stat().st_size - 1),
    "swapped shards": lambda folder: shutil.copy(shard_path(folder, OTHER), shard_path(folder, STEM)) and None,
    "swapped indexes": lambda folder: shutil.copy(index_path(folder, OTHER), index_path(folder, STEM)) and None,
    "a renamed shard": lambda folder: shard_path(folder, STEM).rename(folder / "shards" / "other.tar") and None,
    "no shards at all": lambda folder: shutil.rmtree(folder / "shards"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_every_damage_is_mended_to_the_same_bytes(whole: Path, broken: Path, damage: str) -> None:
    DAMAGE[damage](broken)
    done = repair_from(broken, FolderPlace(whole))
    assert contents(broken) == contents(whole) and verify(broken) == [] and done.mended
    assert repair_from(broken, FolderPlace(whole)).mended == ()


def test_of_a_damaged_shard_only_the_broken_members_are_fetched(whole: Path, broken: Path) -> None:
    index = from_json(ShardIndex, index_path(whole, STEM).read_bytes(), where="")
    members = [index.examples[0].members[1], index.examples[1].members[4]]
    for member in members:
        flip(shard_path(broken, STEM), member.offset + 20)
    place = Counting(whole)
    done = repair_from(broken, place)
    assert place.asked == [f"{member.size} of shards/{index.shard.name}" for member in members]
    assert done.members == tuple(member.name for member in members)
    assert done.fetched == sum(member.size for member in members) and contents(broken) == contents(whole)


def test_files_of_others_are_moved_aside_and_named(whole: Path, broken: Path,
                                                   capsys: pytest.CaptureFixture[str]) -> None:
    (broken / "notes").mkdir()
    (broken / "notes" / "a.txt").write_text("mine")
    (broken / "shards" / "more.tar").symlink_to("/dev/null")
    assert main(["repair", str(broken), "--from", str(whole)]) == 0
    said = capsys.readouterr().out
    assert "set-aside: notes/a.txt" in said and "set-aside: shards/more.tar" in said and "nothing to mend" in said
    assert (broken / ".build" / "set-aside" / "notes" / "a.txt").read_text() == "mine" and verify(broken) == []
    (broken / "notes").mkdir()
    (broken / "notes" / "a.txt").write_text("another")
    repair_from(broken, FolderPlace(whole))
    assert sorted(path.read_text() for path in (broken / ".build" / "set-aside" / "notes").iterdir()) == ["another",
                                                                                                        "mine"]


@pytest.mark.parametrize("name", [".build", ".build/repair", "shards"])
def test_a_link_out_of_the_folder_is_not_followed(whole: Path, broken: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine").write_text("x")
    if (broken / name).is_dir():
        shutil.rmtree(broken / name)
    (broken / name).parent.mkdir(exist_ok=True)
    (broken / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match=f"expected a folder {name}, got a link"):
        repair_from(broken, FolderPlace(whole))
    assert [path.name for path in (tmp_path / "elsewhere").iterdir()] == ["mine"]


@pytest.mark.parametrize("spoil", [lambda path: path.unlink(), cut], ids=["gone", "cut short"])
@pytest.mark.parametrize("all_of_it", [False, True])
def test_a_copy_that_lacks_what_is_wanted_is_named(whole: Path, broken: Path, tmp_path: Path, all_of_it: bool,
                                                   spoil: Callable[[Path], None]) -> None:
    if all_of_it:
        shard_path(broken, STEM).unlink()
    else:
        flip(shard_path(broken, STEM), 700)
    before = contents(broken)
    shutil.copytree(whole, tmp_path / "copy")
    spoil(shard_path(tmp_path / "copy", STEM))
    with pytest.raises(ShardError, match=r"copy: (cannot read|expected SHA-256 .*) shards/tiny.*dataset is as"):
        repair_from(broken, FolderPlace(tmp_path / "copy"))
    assert contents(broken) == before


def test_a_copy_may_lie_at_an_address(whole: Path, broken: Path) -> None:
    flip(shard_path(broken, STEM), 700)
    assert main(["repair", str(broken), "--from", whole.absolute().as_uri()]) == 0
    assert contents(broken) == contents(whole)


def test_what_cannot_be_mended_is_left_as_it_was(whole: Path, broken: Path, tmp_path: Path) -> None:
    build(tmp_path / "other", default_examples() | {3: make_example(3, split="test", view="test/000003", light=5)})
    flip(shard_path(broken, STEM), 700)
    shard_path(broken, OTHER).unlink()
    before = contents(broken)
    with pytest.raises(ShardError, match=r"expected the dataset with SHA-256 .* got another one"):
        repair_from(broken, FolderPlace(tmp_path / "other"))
    # Damaged in the same place, and one file that could be had
    shutil.copytree(whole, tmp_path / "copy")
    flip(shard_path(tmp_path / "copy", STEM), 700)
    with pytest.raises(ShardError, match=f"expected SHA-256 .* of shards/{STEM}.*; the dataset is as it was"):
        repair_from(broken, FolderPlace(tmp_path / "copy"))
    with pytest.raises(ShardError, match="cannot read SHA256SUMS"):
        repair_from(broken, FolderPlace(tmp_path / "nowhere"))
    with one_writer(broken), pytest.raises(OutputError, match="another repair is running"):
        repair_from(broken, FolderPlace(whole))
    assert contents(broken) == before
    for name in ("dataset.json", "SHA256SUMS"):
        (broken / name).unlink()
    with pytest.raises(ShardError, match="to say what this dataset was"):
        repair_from(broken, FolderPlace(whole))
