"""Datasets made to mislead who pulls them: refused before anything large is fetched, and nothing else is touched."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.digest import canonical_json
from dataset_builder.errors import OutputError, ShardError, UserError
from dataset_builder.shards.manifest import from_json
from dataset_builder.shards.shard_index import ShardIndex, tagged
from dataset_builder.transfer.choice import ExampleChoice
from dataset_builder.transfer.pull import pull
from tests.shards.test_hostile import INDEXES, MANIFESTS, TEXTS, put, rewrite
from tests.shards.test_verify import STEM, edit, reseal
from tests.shards.tiny_dataset import contents, index_path
from tests.transfer.conftest import CountingPlace

FOR_VERIFY = {"identity of another name", "no identities", "identity twice", "tolerance beyond all",
              "tolerance below 0"}
"""What readers never look at: it is pulled as it is, and `verify` names it."""
LIES: dict[str, Callable[[Any], None]] = {
    "payload in the next file": put("examples", 0, "members", 1, "offset", value=512),
    "payload beyond the shard": put("examples", 2, "members", 7, "offset", value=2**40),
    "size of the whole shard": put("examples", 0, "members", 0, "size", value=20_000),
    "size of 2 GB": put("examples", 2, "members", 7, "size", value=2**31 - 1),
    "member of another layer": put("examples", 0, "members", 0, "name", value="00000000.albedo.exr"),
    "member that leads up": put("examples", 0, "members", 0, "name", value="00000000.../../d.exr"),
    "member in capitals": put("examples", 0, "members", 0, "name", value="00000000.D.exr"),
    "examples in another order": lambda index: index["examples"].reverse(),
    "examples twice": lambda index: index["examples"].append(index["examples"][0]),
    "an example less": lambda index: index["examples"].pop(),
    "a member less": lambda index: index["examples"][0]["members"].pop(),
}
"""Of an index whose name and sums fit: whoever publishes it means it."""


@pytest.fixture
def origin(home: Path, tmp_path: Path) -> CountingPlace:
    """A copy of the dataset, to be spoilt."""
    shutil.copytree(home, tmp_path / "there")
    return CountingPlace(tmp_path / "there")


@pytest.fixture(autouse=True)
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Opening anything for writing that is not below `here` is a failure."""
    opened = os.open

    def inside(path: Any, flags: int, *arguments: Any, **options: Any) -> int:
        text = os.path.abspath(os.fspath(path))
        assert not flags & (os.O_WRONLY | os.O_RDWR) or f"{tmp_path}/here/" in text or "/there/" in text, text
        return opened(path, flags, *arguments, **options)

    monkeypatch.setattr(os, "open", inside)


def refused(origin: CountingPlace, here: Path, choice: ExampleChoice) -> None:
    with pytest.raises(ShardError):
        pull(origin, here, choice=choice)
    assert not here.exists()
    assert origin.fetched(".tar") == 0


@pytest.mark.parametrize("name", MANIFESTS)
def test_a_hostile_manifest_is_refused(name: str, origin: CountingPlace, tmp_path: Path) -> None:
    rewrite(origin.folder / "dataset.json", MANIFESTS[name])
    if name in FOR_VERIFY:
        pull(origin, tmp_path / "here")
        assert contents(tmp_path / "here") == contents(origin.folder)
    else:
        refused(origin, tmp_path / "here", ExampleChoice())


@pytest.mark.parametrize("choice", [ExampleChoice(), ExampleChoice(light=("1",))])
@pytest.mark.parametrize("name", INDEXES)
def test_a_hostile_index_is_refused(name: str, choice: ExampleChoice, origin: CountingPlace, tmp_path: Path) -> None:
    rewrite(index_path(origin.folder, STEM), INDEXES[name])
    refused(origin, tmp_path / "here", choice)


@pytest.mark.parametrize("choice", [ExampleChoice(), ExampleChoice(layers=("mask",))])
@pytest.mark.parametrize("name", LIES)
def test_an_index_that_lies_is_refused(name: str, choice: ExampleChoice, origin: CountingPlace, tmp_path: Path) -> None:
    forge(origin.folder, LIES[name])
    refused(origin, tmp_path / "here", choice)


@pytest.mark.parametrize("file", ["dataset.json", f"index/{STEM}-*.manifest", "SHA256SUMS"])
@pytest.mark.parametrize("name", TEXTS)
def test_text_that_is_none_of_ours_is_refused(name: str, file: str, origin: CountingPlace, tmp_path: Path) -> None:
    path, = origin.folder.glob(file)
    path.chmod(0o644)
    path.write_bytes(TEXTS[name])
    if file.startswith("index"):
        reseal(origin.folder)
    with pytest.raises(UserError):
        pull(origin, tmp_path / "here")
    assert not (tmp_path / "here/dataset.json").exists()
    assert origin.fetched(".tar") == 0
    assert origin.fetched() < 4 * 10**6


def test_more_than_is_stated_is_not_fetched(origin: CountingPlace, tmp_path: Path) -> None:
    """A shard that goes on without an end is read to the end that is stated."""
    tar, = origin.folder.glob(f"shards/{STEM}-*.tar")
    with tar.open("ab") as stream:
        stream.truncate(2**40)
    pulled = pull(origin, tmp_path / "here")
    assert origin.fetched(".tar") == sum(shard.bytes for shard in pulled.manifest.shards)


def test_what_is_there_stays(home: Path, origin: CountingPlace, tmp_path: Path) -> None:
    pull(home, tmp_path / "here")
    before, kept = contents(tmp_path / "here"), sorted(path.name for path in (tmp_path / "here/.build").iterdir())
    forge(origin.folder, LIES["payload in the next file"])
    with pytest.raises(ShardError, match="one after the other"):
        pull(origin, tmp_path / "here")
    assert before == contents(tmp_path / "here")
    assert kept == sorted(path.name for path in (tmp_path / "here/.build").iterdir())


@pytest.mark.parametrize("where", ["shards", ".build", ".build/pull", ".build/next"])
def test_links_are_not_followed(where: str, home: Path, tmp_path: Path) -> None:
    """Folders that somebody made links of lead elsewhere."""
    other, here = tmp_path / "other", tmp_path / "here"
    other.mkdir()
    (here / where).parent.mkdir(parents=True)
    (here / where).symlink_to(other)
    with pytest.raises(OutputError, match="other files"):
        pull(home, here)
    assert not list(other.iterdir())


def forge(folder: Path, change: Callable[[Any], None]) -> None:
    """Change an index and give it, its shard, `dataset.json` and the sums the names and hashes that fit."""
    path = index_path(folder, STEM)
    content = json.loads(path.read_bytes())
    change(content)
    try:
        index = from_json(ShardIndex, canonical_json(content), where="")
        sealed = tagged(index, index.shard.slot)
        name, data = sealed.shard.stem, canonical_json(sealed.model_dump(mode="json")) + b"\n"
    except ShardError:
        name, data = path.stem, canonical_json(content) + b"\n"
    before = path.stem
    path.unlink()
    (folder / f"index/{name}.manifest").write_bytes(data)
    (folder / f"shards/{before}.tar").rename(folder / f"shards/{name}.tar")
    for file in ("SHA256SUMS", "dataset.json"):
        text = (folder / file).read_text()
        (folder / file).write_text(text.replace(before, name))
    lines = sorted((folder / "SHA256SUMS").read_text().splitlines(), key=lambda line: line.split("  ")[1])
    (folder / "SHA256SUMS").write_text("".join(f"{line}\n" for line in lines))
    edit(folder / "dataset.json", lambda content: None)
