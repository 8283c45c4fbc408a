import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dataset_builder import files
from dataset_builder.errors import OutputError, ShardError
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.verify import verify
from dataset_builder.shards.writer import index_path, publish_shard, published, remove_others, shard_path
from tests.shards.tiny_dataset import VERSIONS, build, contents, default_examples, make_example, plan_digest, stage

ONE_SHARD = {("train", 0): (0, 1)}


class Killed(BaseException):
    """Stands for the end of the process: nothing of ours catches it."""


def after(steps: int, error: BaseException) -> Callable[[Any], Callable[..., Any]]:
    """Wraps functions that share one count of calls; call number `steps` (from 0) raises instead of acting."""
    count = iter(range(1_000_000))

    def wrap(function: Any) -> Callable[..., Any]:
        def wrapped(*arguments: Any) -> Any:
            if next(count) == steps:
                raise error
            return function(*arguments)
        return wrapped
    return wrap


def interrupted(patch: pytest.MonkeyPatch, steps: int, error: BaseException, folder: Path) -> bool:
    """Build with the step number `steps` of all flushes and renames failing; True where the build got to its end."""
    with patch.context() as context:
        wrap = after(steps, error)
        context.setattr(files.os, "replace", wrap(os.replace))
        context.setattr(files.os, "fsync", wrap(os.fsync))
        try:
            build(folder, shards=ONE_SHARD)
        except (Killed, OutputError):
            return False
    return True


def test_two_builds_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        build(tmp_path / name)
    assert contents(tmp_path / "one") == contents(tmp_path / "two")


def test_a_build_over_itself_changes_nothing(dataset: Path) -> None:
    before = contents(dataset)
    build(dataset)
    assert contents(dataset) == before


def test_killed_at_every_step_a_build_goes_on_to_the_same_bytes(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build(tmp_path / "whole", shards=ONE_SHARD)
    expected, steps = contents(tmp_path / "whole"), 0
    while not interrupted(monkeypatch, steps, Killed(), folder := tmp_path / f"cut-{steps}"):
        finished = (folder / "dataset.json").exists()
        assert not finished or verify(folder) == []
        build(folder, shards=ONE_SHARD)
        assert contents(folder) == expected
        steps += 1
    assert steps > 20


def test_an_interrupted_build_does_not_lose_finished_examples(tmp_path: Path) -> None:
    for example in default_examples().values():
        stage(tmp_path, example)
        assert Staging(tmp_path).has(example.key, plan_digest(example))


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EACCES])
def test_a_disk_that_refuses_at_any_step_leaves_nothing_half_published(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    steps = 0
    while not interrupted(monkeypatch, steps, OSError(code, os.strerror(code)), folder := tmp_path / f"full-{steps}"):
        assert not list(folder.rglob("*.partial"))
        assert not (folder / "dataset.json").exists() or verify(folder) == []
        steps += 3
    assert steps > 20


def test_a_full_disk_is_said_to_be_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(OutputError, match=r"the disk is full .*free some space"):
        build(tmp_path / "out")


def test_staged_examples_are_taken_only_for_the_same_plan_and_undamaged(tmp_path: Path) -> None:
    key, name = stage(tmp_path, make_example())
    staging = Staging(tmp_path)
    assert staging.has(key, name) and not staging.has(key, "0" * 64) and not staging.has("00000009", name)
    path, = (tmp_path / ".build" / "staging").glob("*.segment")
    data = bytearray(path.read_bytes())
    data[700] ^= 1
    path.write_bytes(data)
    assert not staging.has(key, name)
    with pytest.raises(ShardError, match="found none that is undamaged"):
        staging.get(key, name)


def test_staging_forgets_the_older_of_two_plans(tmp_path: Path) -> None:
    key, old = stage(tmp_path, make_example(light=0))
    _, new = stage(tmp_path, make_example(light=1))
    staging = Staging(tmp_path)
    assert old != new and staging.has(key, new) and not staging.has(key, old)
    staging.drop(key)
    assert not staging.has(key, new)


def test_a_shard_counts_only_with_an_index_that_agrees(dataset: Path) -> None:
    stem = "tiny-v1-train-000000"
    done = published(dataset, stem)
    assert done is not None and done.shard.examples == 2
    with shard_path(dataset, stem).open("r+b") as stream:
        stream.seek(9000)
        stream.write(b"!")
    assert published(dataset, stem) is None
    index_path(dataset, "tiny-v1-train-000001").unlink()
    assert published(dataset, "tiny-v1-train-000001") is None
    before = verify(dataset)
    assert before
    build(dataset)
    assert verify(dataset) == []


def test_the_size_of_what_waits_leaves_out_what_goes_meanwhile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    staging = Staging(tmp_path)
    staging.put("00000000", "a", b"12345", {})
    staging.put("00000001", "b", b"123", {})
    whole, found = staging.size(), staging._files("*")
    lost = found[0].stat().st_size
    found[0].unlink()
    monkeypatch.setattr(staging, "_files", lambda pattern: found)
    assert whole > staging.size() == whole - lost


def test_publishing_takes_the_commit_point_away_first(dataset: Path) -> None:
    staged = stage(dataset, make_example())
    publish_shard(dataset, stem="tiny-v1-train-000000", split="train", examples=[staged], spec_digest="", versions={})
    assert not (dataset / "dataset.json").exists()


def test_a_shard_needs_its_examples_once_each(tmp_path: Path) -> None:
    staged = stage(tmp_path, make_example())
    wrong = (([], "one or more"), ([staged, staged], "different keys"), ([("00000009", "x")], "00000009"))
    for examples, rule in wrong:
        with pytest.raises(ShardError, match=rule):
            publish_shard(tmp_path, stem="s", split="train", examples=examples, spec_digest="", versions=VERSIONS)


def test_shard_bytes_do_not_depend_on_the_order_of_staging(tmp_path: Path) -> None:
    examples = [make_example(index) for index in (5, 2, 9)]
    for name, order in (("a", examples), ("b", examples[::-1])):
        staged = [stage(tmp_path / name, example) for example in order]
        publish_shard(tmp_path / name, stem="s", split="train", examples=staged, spec_digest="", versions=VERSIONS)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_what_an_earlier_plan_left_is_taken_away(dataset: Path) -> None:
    keep = ["tiny-v1-train-000000", "tiny-v1-train-000001"]
    (dataset / "shards" / "tiny-v1-train-000000.tar.partial").write_bytes(b"cut")
    assert remove_others(dataset, keep) == [
        "tiny-v1-test-000000.manifest", "tiny-v1-test-000000.tar", "tiny-v1-train-000000.tar.partial"]
    assert not (dataset / "dataset.json").exists() and remove_others(dataset, keep) == []
    build(dataset)
    assert verify(dataset) == []
