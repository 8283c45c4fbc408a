"""Releases that others can pull: `dataset.json` last, names that keep their content, and pushes that go on."""

import shutil
from pathlib import Path

import pytest

from dataset_builder.errors import OutputError, ShardError, UserError
from dataset_builder.remote import upload
from dataset_builder.remote.upload import FolderShelf
from dataset_builder.transfer.pull import pull
from dataset_builder.transfer.push import push
from tests.file_servers import KEYS, s3_server
from tests.shards.tiny_dataset import contents, make_example
from tests.transfer.conftest import examples, made


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of files in the order that they are put into a folder, which fails at one called `stop`."""
    names, put = list[str](), FolderShelf.put

    def told(self: FolderShelf, name: str, source: Path) -> None:
        if names[-1:] == ["stop"]:
            raise UserError("gone")
        names.append(name)
        put(self, name, source)

    monkeypatch.setattr(upload.FolderShelf, "put", told)
    return names


@pytest.fixture
def newer(tmp_path: Path) -> Path:
    """Another build of the dataset, with one shard that differs."""
    return made(tmp_path / "newer/tiny", chosen={**examples(), 4: make_example(4, view="train/000002", light=0)})


def test_what_is_pushed_can_be_pulled(home: Path, tmp_path: Path, log: list[str]) -> None:
    pushed = push(home, tmp_path / "there")
    assert contents(tmp_path / "there") == contents(home)
    assert (pushed.files, pushed.sent) == (14, sum(map(len, contents(home).values())))
    assert log[-4:] == ["README.md", "croissant.json", "SHA256SUMS", "dataset.json"]
    pull(tmp_path / "there", tmp_path / "here", sha256=pushed.sha256)
    assert contents(tmp_path / "here") == contents(home)
    assert push(home, f"file://{tmp_path}/there").files == 0


def test_a_push_that_was_cut_short_goes_on(home: Path, tmp_path: Path, log: list[str]) -> None:
    there = tmp_path / "there"
    push(home, there)
    names = list(log)
    for name in ("dataset.json", "SHA256SUMS", names[3]):
        (there / name).unlink()
    (there / "shards/x.tar.partial").write_bytes(b"half")
    log.clear()
    assert push(home, there).files == 3
    assert log == [names[3], "SHA256SUMS", "dataset.json"]


def test_it_fails_whole(home: Path, tmp_path: Path, log: list[str]) -> None:
    log.append("stop")
    with pytest.raises(UserError, match="gone"):
        push(home, tmp_path / "there")
    assert not (tmp_path / "there/dataset.json").exists()


def test_names_keep_their_content(home: Path, tmp_path: Path) -> None:
    there = tmp_path / "there"
    for spoilt in ("shards/*train-000000*", "index/*test-000001*"):
        push(home, there)
        path, = there.glob(spoilt)
        path.chmod(0o644)
        path.write_bytes(path.read_bytes()[:-1] + b"x")
        (there / "dataset.json").unlink()
        before = contents(there)
        with pytest.raises(OutputError, match="other content under this name"):
            push(home, there, replace=True)
        assert contents(there) == before
        shutil.rmtree(there)


def test_another_release_is_refused_unless_asked(home: Path, newer: Path, tmp_path: Path) -> None:
    there = tmp_path / "there"
    push(home, there)
    with pytest.raises(OutputError, match=r"got tiny 1\.0\.0 with other content .*--replace"):
        push(newer, there)
    assert contents(there) == contents(home)
    pushed = push(newer, there, replace=True)
    assert pushed.files == 5
    assert [Path(name).suffix for name in pushed.left] == [".manifest", ".tar"]
    assert contents(there) == {**contents(home), **contents(newer)}
    assert push(newer, there, prune=True).left == ()
    assert contents(there) == contents(newer)


def test_a_damaged_dataset_is_not_sent(home: Path, tmp_path: Path) -> None:
    shutil.copytree(home, tmp_path / "here")
    path, = (tmp_path / "here").glob("shards/*test-000001*")
    path.chmod(0o644)
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    (tmp_path / "here/croissant.json").unlink()
    with pytest.raises(ShardError) as caught:
        push(tmp_path / "here", tmp_path / "there")
    assert [problem.path.split("-")[-2:] for problem in caught.value.problems] == [
        ["000001", f"{path.name.split('-')[-1]}"], ["croissant.json"]]
    assert not (tmp_path / "there").exists()


def test_places_that_cannot_be_written(home: Path) -> None:
    with pytest.raises(UserError, match="a place that can be written, got https"):
        push(home, "https://example.org/tiny")
    with pytest.raises(UserError, match="expected hf://datasets/USER/NAME"):
        push(home, "hf://tiny")


def test_to_s3(home: Path, newer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)
    (tmp_path / "none").mkdir()
    with s3_server(tmp_path / "none", "bucket") as address:
        monkeypatch.setenv("AWS_ENDPOINT_URL", address)
        with pytest.raises(UserError, match=r"s3://no-such-bucket/a: .*see to the bucket"):
            push(home, "s3://no-such-bucket/a")
        assert push(home, "s3://bucket/sets/tiny").files == 14
        assert push(home, "s3://bucket/sets/tiny").files == 0
        push(newer, "s3://bucket/sets/tiny", replace=True, prune=True)
        pull("s3://bucket/sets/tiny", tmp_path / "here")
    assert contents(tmp_path / "here") == contents(newer)
