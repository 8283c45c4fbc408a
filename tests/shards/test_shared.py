"""Files that examples of one view share: readers find the same pixels, and nothing but what is shared."""

import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import ShardError
from dataset_builder.shards.card import card
from dataset_builder.shards.croissant import croissant
from dataset_builder.shards.published_examples import PublishedExamples
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.shards.verify import verify
from tests.shards.test_verify import edit, found, load_index
from tests.shards.tiny_dataset import (
    build,
    contents,
    default_examples,
    index_path,
    make_example,
    plan_digest,
    shard_path,
    stage,
)

STEM = "tiny-v1-train-000000"
LIGHT_FREE = ("d", "i_s", "mask", "r")
"""What the two examples of the first view have in common: their lights differ."""
LEVELS = {("train", 0): (0, 1, 2), ("test", 0): (3,)}
"""Three examples in one shard, all of one view."""


def levels() -> dict[int, Any]:
    """Three examples under one light, as the noise levels of a view are, that differ in the raw lighting alone."""
    made = default_examples()
    for index in (1, 2):
        layers = dict(made[0].layers)
        layers["s_prime"] = layers["s_prime"] * np.float32(1 - 0.1 * index)
        made[index] = make_example(index, view="train/000000", light=0, layers=layers)
    return made


@pytest.fixture
def once(tmp_path: Path) -> Path:
    build(tmp_path / "once", shared="once")
    return tmp_path / "once"


def names(folder: Path) -> list[str]:
    with tarfile.open(shard_path(folder, STEM)) as tar:
        return tar.getnames()


@pytest.mark.parametrize("dtype", ["float32", "float16"])
def test_readers_find_what_each_example_holds(dtype: Any, tmp_path: Path) -> None:
    build(tmp_path / "each", levels(), shards=LEVELS, dtype=dtype)
    build(tmp_path / "once", levels(), shards=LEVELS, dtype=dtype, shared="once")
    each, once = open_dataset(tmp_path / "each"), open_dataset(tmp_path / "once")
    assert each.splits == once.splits and len(once) == 4
    for key in [*once.splits["train"], *once.splits["test"]]:
        first, other = each[key], once[key]
        assert first.pop("meta") == other.pop("meta") and once.label(key).key == key
        assert all(np.array_equal(first[name], other[name]) for name in {**first, **other})
    sizes = [shard_path(tmp_path / name, STEM).stat().st_size for name in ("each", "once")]
    assert sizes[1] < 0.85 * sizes[0] and verify(tmp_path / "once") == []


def test_the_first_of_a_view_has_the_file_and_others_point_at_it(once: Path) -> None:
    first, other = load_index(once).examples
    assert all(member.key == first.key for member in first.members)
    assert [member.name for member in other.members if member.key != other.key] == [
        f"{first.key}.{layer}.exr" for layer in LIGHT_FREE]
    assert set(other.members) & set(first.members) == set(other.members) - set(other.own)
    assert names(once) == [member.name for example in (first, other) for member in example.own]
    assert len(names(once)) == 16 - len(LIGHT_FREE)


def test_views_do_not_share_even_equal_pixels(tmp_path: Path) -> None:
    examples = default_examples()
    examples[1] = make_example(1, view="train/000001", layers=dict(examples[0].layers))
    build(tmp_path / "out", examples, shared="once")
    assert len(names(tmp_path / "out")) == 16 and verify(tmp_path / "out") == []


def test_two_builds_give_equal_bytes(once: Path, tmp_path: Path) -> None:
    build(tmp_path / "again", shared="once")
    build(tmp_path / "each")
    assert contents(once) == contents(tmp_path / "again")
    assert contents(once).keys() != contents(tmp_path / "each").keys()


def test_what_is_published_is_taken_over_with_files_of_its_own(once: Path, tmp_path: Path) -> None:
    """Byte for byte what would be staged, so that another way of storing renders nothing."""
    for example in default_examples().values():
        known = PublishedExamples(once).get(plan_digest(example))
        stage(tmp_path / "fresh", example)
        staged, = (tmp_path / "fresh").rglob(f"{example.key}.*.segment")
        assert known is not None and known.segment == staged.read_bytes()
        assert all(member["name"].startswith(example.key) for member in known.entry["members"])


def test_a_damaged_file_is_damaged_for_all_who_share_it(once: Path) -> None:
    member = load_index(once).examples[0].members[0]
    path = shard_path(once, STEM)
    data = bytearray(path.read_bytes())
    data[member.offset + member.size // 2] ^= 4
    path.write_bytes(data)
    for key in ("00000000", "00000001"):
        with pytest.raises(ShardError, match=r"of 00000000\.d\.exr, its bytes differ"):
            open_dataset(once, layers=["d"])[key]
        assert PublishedExamples(once).get(plan_digest(default_examples()[int(key)])) is None


def borrowed(index: Any, member: int, of: int, **changes: Any) -> None:
    """Let the second example's `member` be the first one's `of`, with changes."""
    index["examples"][1]["members"][member] = {**index["examples"][0]["members"][of], **changes}


@pytest.mark.parametrize(("change", "rule"), [
    (lambda index: index["examples"][1].update(view="train/000009"), "or of an earlier example of its view"),
    (lambda index: borrowed(index, 0, 0, offset=7), "got '00000000.d.exr'"),
    (lambda index: borrowed(index, 0, 0, size=5), "got '00000000.d.exr'"),
    (lambda index: borrowed(index, 0, 0, sha256="0"), "got '00000000.d.exr'"),
    (lambda index: borrowed(index, 0, 0, pixel_digest="0"), "got '00000000.d.exr'"),
    (lambda index: borrowed(index, 0, 0, name="00000003.d.exr"), "got '00000003.d.exr'"),
    (lambda index: borrowed(index, 0, 0, name="../../d.exr"), "got '../../d.exr'"),
    (lambda index: index["examples"].reverse(), "or of an earlier example of its view"),
    (lambda index: borrowed(index, 0, 6), "expected members d.exr"),
    (lambda index: borrowed(index, 3, 3), "expected them in the shard under its own key, got ['00000000.json']"),
], ids=["view", "offset", "size", "hash", "pixels", "shard", "outside", "later", "suffix", "label"])
def test_an_entry_that_shares_what_it_may_not_is_found(once: Path, change: Callable[[Any], None], rule: str) -> None:
    edit(index_path(once, STEM), change)
    assert rule in found(once)
    with pytest.raises(ShardError):
        open_dataset(once, verify="off")["00000001"]


def test_a_dataset_that_says_each_shares_nothing(once: Path) -> None:
    edit(once / "dataset.json", lambda manifest: manifest.update(shared="each"))
    assert "00000001: expected them in the shard under its own key, got ['00000000.d.exr', " in found(once)


@pytest.mark.parametrize("key", ["00000000", "00000001"])
def test_the_header_names_the_owner(once: Path, key: str) -> None:
    path = shard_path(once, STEM)
    head, owner = b"3df-lighting:key\0string\0\x08\0\0\0", b"00000000"
    assert path.read_bytes().index(head + owner) < load_index(once).examples[0].members[1].offset
    path.write_bytes(path.read_bytes().replace(head + owner, head + b"00000001", 1))
    with pytest.raises(ShardError, match="expected layer d of example 00000000, its header says 'd' of '00000001'"):
        open_dataset(once, verify="off")[key]


def test_card_and_catalogue_tell_who_sees_all_files(once: Path, tmp_path: Path) -> None:
    build(tmp_path / "each")
    for text in (card, croissant):
        assert "stored once" in text(load_manifest(once))
        assert "stored once" not in text(load_manifest(tmp_path / "each"))
