import contextlib
import errno
import itertools
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from dataset_builder import files
from dataset_builder.errors import OutputError, ShardError, UserError
from dataset_builder.shards.folder import next_of
from dataset_builder.shards.publish import published
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.verify import verify
from dataset_builder.shards.writer import publish_shard
from tests.shards.tiny_dataset import (
    VERSIONS,
    build,
    contents,
    default_examples,
    index_path,
    make_example,
    plan_digest,
    shard_path,
    stage,
)

ONE_SHARD = {("train", 0): (0, 1)}


class Killed(BaseException):
    """Stands for the end of the process: nothing of ours catches it."""


def after(steps: int, error: BaseException, count: Iterator[int]) -> Callable[[Any], Callable[..., Any]]:
    """Wraps functions that share one count of calls; call number `steps` (from 0) raises instead of acting."""

    def wrap(function: Any) -> Callable[..., Any]:
        def wrapped(*arguments: Any, **options: Any) -> Any:
            if next(count) == steps:
                raise error
            return function(*arguments, **options)
        return wrapped
    return wrap


STEPS = ("replace", "fsync", "unlink")
"""What a build asks of the disk that changes a file; the patched `os` is everybody's."""


def interrupted(patch: pytest.MonkeyPatch, steps: int, error: BaseException, run: Callable[[], object],
                what: tuple[str, ...] = ("replace", "fsync")) -> bool:
    """Run with step number `steps` of all that is asked of the disk failing; True where there are fewer."""
    count = itertools.count()
    with patch.context() as context, contextlib.suppress(Killed, UserError):
        wrap = after(steps, error, count)
        for name in what:
            context.setattr(files.os, name, wrap(getattr(os, name)))
        run()
    return next(count) <= steps


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
    while not interrupted(
            monkeypatch, steps, Killed(), partial(build, folder := tmp_path / f"cut-{steps}", shards=ONE_SHARD)):
        finished = (folder / "dataset.json").exists()
        assert not finished or verify(folder) == []
        build(folder, shards=ONE_SHARD)
        assert contents(folder) == expected
        steps += 1
    assert steps > 20


@pytest.mark.parametrize(("error", "stride"), [(Killed(), 1), (OSError(errno.ENOSPC, "No space left"), 5)])
def test_an_edit_cut_short_at_any_step_leaves_the_old_or_the_new_dataset(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, stride: int) -> None:
    # One shard stays, one changes, one goes, one comes
    edited = default_examples() | {2: make_example(2, view="train/000002", light=5)}
    shards = {("train", 0): (0, 1), ("train", 1): (2,), ("test", 1): (3,)}
    build(tmp_path / "old")
    build(tmp_path / "new", edited, shards=shards)
    old, new = contents(tmp_path / "old"), contents(tmp_path / "new")
    steps, found, edit = 0, Counter[str](), partial(build, tmp_path / "cut", edited, shards=shards)
    while True:
        shutil.copytree(tmp_path / "old", folder := tmp_path / "cut")
        whole = interrupted(monkeypatch, steps, error, edit, STEPS)
        assert verify(folder) == [] and len(list(open_dataset(folder))) == 4
        manifest = (folder / "dataset.json").read_bytes()
        found["old" if manifest == old["dataset.json"] else "new"] += 1
        assert manifest in (old["dataset.json"], new["dataset.json"])
        assert not whole or contents(folder) == new
        edit()
        assert contents(folder) == new
        shutil.rmtree(folder)
        if whole:
            break
        steps += stride
    assert steps > 50 and found["old"] > 25 / stride and found["new"] > 10 / stride


def test_an_interrupted_build_does_not_lose_finished_examples(tmp_path: Path) -> None:
    for example in default_examples().values():
        stage(tmp_path, example)
        assert Staging(tmp_path).has(example.key, plan_digest(example))


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EACCES])
def test_a_disk_that_refuses_at_any_step_leaves_nothing_half_published(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    steps = 0
    while not interrupted(monkeypatch, steps, OSError(code, os.strerror(code)),
                          partial(build, folder := tmp_path / f"full-{steps}", shards=ONE_SHARD)):
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
    path, reference = shard_path(dataset, "tiny-v1-train-000000"), contents(dataset)
    done = published(dataset, path.stem)
    assert done is not None and done.shard.examples == 2
    with path.open("r+b") as stream:
        stream.seek(9000)
        stream.write(b"!")
    assert published(dataset, path.stem) is None
    other = index_path(dataset, "tiny-v1-train-000001")
    other.unlink()
    assert published(dataset, other.stem) is None
    assert verify(dataset)
    build(dataset)
    assert contents(dataset) == reference


def test_whatever_is_changed_in_an_index_the_shard_is_made_again(dataset: Path) -> None:
    path, reference = index_path(dataset, "tiny-v1-train-000000"), contents(dataset)
    whole = path.read_bytes()
    for at in range(0, len(whole), 7):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << at % 7]) + whole[at + 1:])
        assert published(dataset, path.stem) is None, at
    (dataset / "SHA256SUMS").write_text("")
    build(dataset)
    assert contents(dataset) == reference


def test_the_size_of_what_waits_leaves_out_what_goes_meanwhile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    staging = Staging(tmp_path)
    staging.put("00000000", "a", b"12345", {})
    staging.put("00000001", "b", b"123", {})
    whole, found = staging.size(), sorted((tmp_path / ".build" / "staging").iterdir())
    lost = found[0].stat().st_size
    found[0].unlink()
    monkeypatch.setattr(Path, "glob", lambda folder, pattern: found)
    assert whole > staging.size() == whole - lost


def test_a_new_shard_waits_beside_the_old_dataset(dataset: Path) -> None:
    before, staged = contents(dataset), stage(dataset, make_example())
    index = publish_shard(dataset, slot="tiny-v1-train-000000", split="train", examples=[staged], spec_digest="",
                          versions={})
    assert contents(dataset) == before and verify(dataset) == []
    assert published(next_of(dataset), index.shard.stem) == index


def test_a_shard_needs_its_examples_once_each(tmp_path: Path) -> None:
    staged = stage(tmp_path, make_example())
    wrong = (([], "one or more"), ([staged, staged], "different keys"), ([("00000009", "x")], "00000009"))
    for examples, rule in wrong:
        with pytest.raises(ShardError, match=rule):
            publish_shard(tmp_path, slot="s", split="train", examples=examples, spec_digest="", versions=VERSIONS)


def test_shard_bytes_do_not_depend_on_the_order_of_staging(tmp_path: Path) -> None:
    examples = [make_example(index) for index in (5, 2, 9)]
    for name, order in (("a", examples), ("b", examples[::-1])):
        staged = [stage(tmp_path / name, example) for example in order]
        publish_shard(tmp_path / name, slot="s", split="train", examples=staged, spec_digest="", versions=VERSIONS)
    assert contents(next_of(tmp_path / "a")) == contents(next_of(tmp_path / "b"))


def test_what_an_earlier_plan_left_is_taken_away(dataset: Path, tmp_path: Path) -> None:
    gone = [shard_path(dataset, "tiny-v1-train-000001"), index_path(dataset, "tiny-v1-train-000001")]
    (next_of(dataset) / "shards").mkdir(parents=True)
    (next_of(dataset) / "shards" / "tiny-v1-train-000000.tar.partial").write_bytes(b"cut")
    shards = {("train", 0): (0, 1), ("test", 0): (3,)}
    build(dataset, shards=shards)
    build(tmp_path / "fresh", shards=shards)
    assert not any(path.exists() for path in [*gone, next_of(dataset)]) and verify(dataset) == []
    assert contents(dataset) == contents(tmp_path / "fresh")
