"""Pushing to Hugging Face's hub, played by an object with the calls of `HfApi` that are used: no hub is asked here."""

import hashlib
import inspect
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import huggingface_hub
import pytest

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import OutputError, ShardError, UserError
from dataset_builder.transfer.outgoing import Pushed, outgoing
from dataset_builder.transfer.push_hub import push_to_hub
from tests.shards.tiny_dataset import contents, make_example
from tests.transfer.conftest import examples, made

ADDRESS = "hf://datasets/me/tiny"
LARGE = (".tar", ".png")
"""What the hub keeps as large files."""


@dataclass
class FakeHub:
    """A repository, what was sent before its commits, and the calls in order."""

    files: dict[str, bytes] = field(default_factory=lambda: {".gitattributes": b"*.tar filter=lfs\n"})
    waiting: set[str] = field(default_factory=set)
    calls: list[str] = field(default_factory=list)
    stop_at: str = ""
    spoil: str = ""

    def __getattribute__(self, name: str) -> Any:
        """Every call must be one that the real class takes."""
        found = object.__getattribute__(self, name)
        if not hasattr(huggingface_hub.HfApi, name):
            return found

        def checked(**arguments: Any) -> Any:
            inspect.signature(getattr(huggingface_hub.HfApi, name)).bind(None, **arguments)
            self.calls.append(name)
            return found(**arguments)

        return checked

    def create_repo(self, **arguments: Any) -> None:
        assert arguments["private"]
        assert arguments["exist_ok"]

    def create_branch(self, **arguments: Any) -> None:
        assert arguments["branch"]

    def repo_info(self, **arguments: Any) -> SimpleNamespace:
        return SimpleNamespace(sha=self._head())

    def list_repo_tree(self, **arguments: Any) -> Iterator[SimpleNamespace]:
        yield SimpleNamespace(path="shards", tree_id="")
        for name, data in self.files.items():
            blob = hashlib.sha1(f"blob {len(data)}\0".encode() + data).hexdigest()
            lfs = SimpleNamespace(sha256=sha256_bytes(data)) if name.endswith(LARGE) else None
            yield SimpleNamespace(path=name, size=len(data), lfs=lfs, blob_id=blob)

    def preupload_lfs_files(self, *, additions: Sequence[Any], **arguments: Any) -> None:
        for one in additions:
            if self.stop_at and self.stop_at in one.path_in_repo:
                raise ConnectionError("https://me:secret@example.org/a?key=secret cannot be reached")
            if one.path_in_repo.endswith(LARGE):
                self.waiting.add(one.path_in_repo)

    def create_commit(self, *, operations: Sequence[Any], parent_commit: str, **arguments: Any) -> None:
        assert parent_commit == self._head()
        for one in operations:
            if isinstance(one, huggingface_hub.CommitOperationDelete):
                del self.files[one.path_in_repo]
                continue
            assert not one.path_in_repo.endswith(LARGE) or one.path_in_repo in self.waiting
            data = Path(str(one.path_or_fileobj)).read_bytes()
            self.files[one.path_in_repo] = data[:-1] if self.spoil and self.spoil in one.path_in_repo else data

    def hf_hub_download(self, *, filename: str, local_dir: str, **arguments: Any) -> str:
        (Path(local_dir) / filename).write_bytes(self.files[filename])
        return str(Path(local_dir) / filename)

    def _head(self) -> str:
        return sha256_bytes(repr(self.files).encode())


def send(folder: Path, hub: FakeHub, address: str = ADDRESS, **how: bool) -> Pushed:
    origin, files = outgoing(folder)
    told: Callable[[Any], None] = lambda progress: None  # noqa: E731
    return push_to_hub(origin, files, address, api=hub, told=told,  # type: ignore[arg-type]
                       **{"replace": False, "prune": False, **how})


def test_a_release_appears_by_one_commit(home: Path) -> None:
    hub = FakeHub()
    assert send(home, hub).files == 14
    hub.files.pop(".gitattributes")
    assert hub.files == contents(home)
    assert hub.calls.count("create_commit") == 1
    assert send(home, hub, f"{ADDRESS}@v1").files == 0
    assert hub.calls.count("create_commit") == 1


def test_a_push_that_was_cut_short_shows_nothing(home: Path) -> None:
    hub = FakeHub(stop_at="test-000001")
    with pytest.raises(UserError, match="cannot be reached") as caught:
        send(home, hub)
    assert "secret" not in str(caught.value)
    assert list(hub.files) == [".gitattributes"]
    assert hub.waiting


def test_another_release_and_what_it_leaves(home: Path, tmp_path: Path) -> None:
    newer = made(tmp_path / "newer/tiny", chosen={**examples(), 4: make_example(4, view="train/000002", light=0)})
    hub = FakeHub()
    send(home, hub)
    with pytest.raises(OutputError, match=r"hf://datasets/me/tiny: dataset\.json: .* with other content"):
        send(newer, hub)
    assert len(send(newer, hub, replace=True).left) == 2
    send(newer, hub, prune=True)
    assert {**hub.files, ".gitattributes": b""} == {**contents(newer), ".gitattributes": b""}


def test_names_keep_their_content_and_what_is_seen_is_looked_at(home: Path, tmp_path: Path) -> None:
    hub = FakeHub(spoil="croissant")
    with pytest.raises(ShardError, match=r"croissant\.json: expected it as it was sent"):
        send(home, hub)
    hub, other = FakeHub(), tmp_path / "other"
    send(home, hub)
    shutil.copytree(home, other)
    name = next(name for name in hub.files if "train-000002" in name and name.endswith(".tar"))
    hub.files[name] = bytes(len(hub.files[name]))
    with pytest.raises(OutputError, match="other content under this name"):
        send(other, hub)
