"""Chosen examples: a dataset of their own, as a build of them would be, and little else is fetched."""

import json
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.digest import sha256_file
from dataset_builder.errors import OutputError, UserError
from dataset_builder.label.shared_content import SharedContent
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.verify import verify
from dataset_builder.transfer.choice import ExampleChoice
from dataset_builder.transfer.pull import pull
from tests.shards.test_verify import edit
from tests.shards.tiny_dataset import Shared, build, contents
from tests.transfer.conftest import CountingPlace, examples, made

CHOICES: list[tuple[ExampleChoice, list[int]]] = [
    (ExampleChoice(split=("test",)), [8, 9, 10, 11]),
    (ExampleChoice(scene=("train-room-00",)), [0, 1, 2, 3, 4, 5]),
    (ExampleChoice(object=("*-chair-*",)), [2, 3, 8, 9]),
    (ExampleChoice(category=("chair", "lamp")), [2, 3, 4, 5, 8, 9, 10, 11]),
    (ExampleChoice(level=("coarse",)), [2, 3, 6, 7, 10, 11]),
    (ExampleChoice(level=("0",), split=("t*n",)), [0, 1, 4, 5]),
    (ExampleChoice(light=("1",)), [1, 3, 5, 7, 9, 11]),
    (ExampleChoice(light=("1",), level=("fine",), count=1), [1, 9]),
    (ExampleChoice(count=2), [0, 1, 8, 9]),
    (ExampleChoice(count=100), list(range(12))),
]


@pytest.mark.parametrize(("choice", "wanted"), CHOICES)
def test_chosen_examples_are_a_dataset(choice: ExampleChoice, wanted: list[int], home: Path, tmp_path: Path) -> None:
    place, here = CountingPlace(home), tmp_path / "here"
    pulled = pull(place, here, choice=choice)
    assert verify(here) == []
    part, whole = open_dataset(here, verify="shard"), open_dataset(home)
    assert [example["meta"]["index"] for example in part] == wanted
    for example in part:
        other = whole[example["meta"]["key"]]
        assert example.keys() == other.keys()
        assert all(np.array_equal(example[name], other[name]) for name in part.layers)
        assert example["meta"] == other["meta"]
    record = load_manifest(here).subset
    assert record is not None
    assert (record.sha256, record.examples, record.asked) == (sha256_file(home / "dataset.json"), 12, choice.asked())
    # Nothing else came over the wire but what lies between neighbours: headers and paddings
    assert pulled.wanted <= place.fetched(".tar") < pulled.wanted + len(wanted) * 8 * 1024
    if not choice.by_index:
        assert place.fetched(".tar") == pulled.wanted
    place.log.clear()
    assert pull(place, here, choice=choice).moved == 0
    assert {piece.name for piece in place.log} == {"dataset.json", "SHA256SUMS"}


def test_what_splits_share_is_told_where_both_are_there(home: Path, tmp_path: Path) -> None:
    shared = SharedContent(what="objects", splits=("train", "test"), count=1, of=(2, 1))
    shutil.copytree(home, tmp_path / "whole")
    manifest = load_manifest(home).model_copy(update={"in_common": (shared,)})
    with build_lock(tmp_path / "whole", Claim(name=manifest.name, version=manifest.version), replace=False):
        publish_dataset(tmp_path / "whole", manifest)
    whole = shared.model_copy(update={"whole": True})
    assert whole.sentence == f"in the whole dataset, {shared.sentence}"
    for name, choice, told in (("both", ExampleChoice(count=2), (whole,)),
                               ("one", ExampleChoice(split=("test",)), ())):
        pull(tmp_path / "whole", tmp_path / name, choice=choice)
        assert load_manifest(tmp_path / name).in_common == told


@pytest.mark.parametrize("shared", ["each", "once"])
def test_shards_are_those_of_a_build(shared: Shared, home: Path, shared_home: Path, tmp_path: Path) -> None:
    """Also where the example is not chosen that a shared file was written for."""
    pull(home if shared == "each" else shared_home, tmp_path / "here", choice=ExampleChoice(light=("1",)))
    made_of = {("train", 0): (1, 3, 5), ("train", 2): (7,), ("test", 0): (9,), ("test", 1): (11,)}
    build(tmp_path / "built", examples(), shards=made_of, shared=shared)
    for folder in ("shards", "index"):
        assert contents(tmp_path / "here" / folder) == contents(tmp_path / "built" / folder)


def test_a_shard_that_is_wanted_whole_stays_as_it_is(home: Path, tmp_path: Path) -> None:
    pull(home, tmp_path / "here", choice=ExampleChoice(scene=("train-room-00",)))
    kept = {path.name for path in (tmp_path / "here/shards").iterdir()}
    assert kept == {path.name for path in home.glob("shards/*-train-00000[01]-*")}


def test_shared_files_come_once(shared_home: Path, tmp_path: Path) -> None:
    place, here = CountingPlace(shared_home), tmp_path / "here"
    pulled = pull(place, here, choice=ExampleChoice(layers=("i_s", "d")))
    assert verify(here) == []
    spans = sorted(piece for piece in place.log if piece.name.endswith(".tar"))
    assert all(one.name < other.name or one.start + one.size <= other.start for one, other in pairwise(spans))
    assert pulled.wanted <= place.fetched(".tar") < sum(shard.bytes for shard in load_manifest(shared_home).shards)
    assert load_manifest(here).shared == "once"
    part, whole = open_dataset(here), open_dataset(shared_home, layers=["i_s", "d"])
    for one, other in zip(part, whole, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in ("i_s", "d"))


def test_layers_alone(home: Path, tmp_path: Path) -> None:
    place, here = CountingPlace(home), tmp_path / "here"
    pull(place, here, choice=ExampleChoice(layers=("mask", "i_?"), count=3))
    assert verify(here) == []
    assert [layer.name for layer in load_manifest(here).layers] == ["i_s", "i_t", "mask"]
    index = from_json(ShardIndex, next((here / "index").iterdir()).read_bytes(), where="")
    source = from_json(ShardIndex, next(home.glob("index/*test-000000*")).read_bytes(), where="")
    assert {member.suffix for example in index.examples for member in example.members} == {
        "i_s.exr", "i_t.exr", "mask.exr", "json", "preview.png"}
    # Nothing may take such an example for a whole one
    assert not {example.digest for example in index.examples} & {example.digest for example in source.examples}


def test_what_is_said_of_a_subset(home: Path, tmp_path: Path) -> None:
    pull(home, tmp_path / "here", choice=ExampleChoice(object=("*chair*",), layers=("i_s", "mask"), count=1))
    card = (tmp_path / "here/README.md").read_text()
    assert "subset of tiny 1.0.0, which has 12 examples" in card
    assert r"--object \*chair\* --layers i\_s,mask --count 1" in card
    croissant = json.loads((tmp_path / "here/croissant.json").read_text())
    assert croissant["prov:wasDerivedFrom"].startswith(f"tiny 1.0.0, dataset.json {sha256_file(home / 'dataset.json')}")
    assert "subset" not in json.loads((home / "dataset.json").read_text())
    again = load_manifest(tmp_path / "here")
    assert Manifest.model_validate(again.model_dump()) == again


@pytest.mark.parametrize(("choice", "message"), [
    (ExampleChoice(split=("trian",)), r"split: .*\(train, test\), got 'trian'"),
    (ExampleChoice(object=("sofa",)), r"object: .*\(train-stool-00, train-chair-00, .* got 'sofa'"),
    (ExampleChoice(object=("*chair*", "sofa"), count=1), r"got 'sofa'"),
    (ExampleChoice(level=("3",)), r"level: .*\(0 or fine, 1 or coarse\), got '3'"),
    (ExampleChoice(layers=("i_s", "depth")), r"layers: .*got 'depth'"),
    (ExampleChoice(object=("train-*",), split=("test",)), r"got 'train-\*'"),
    (ExampleChoice(category=("chair",), scene=("train-room-01",)), "no example matches all that is asked"),
])
def test_a_choice_of_nothing_is_refused(choice: ExampleChoice, message: str, home: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=message):
        pull(home, tmp_path / "here", choice=choice)
    assert not (tmp_path / "here").exists()


def test_choices_that_are_none() -> None:
    with pytest.raises(UserError, match="count: expected a whole number >= 1"):
        ExampleChoice(count=0)
    with pytest.raises(UserError, match="object: expected a list of patterns, got the text 'chair'"):
        ExampleChoice(object="chair")  # type: ignore[arg-type]


def test_another_choice_takes_no_place_unasked(home: Path, tmp_path: Path) -> None:
    here = tmp_path / "here"
    pull(home, here, choice=ExampleChoice(count=1))
    before = contents(here)
    for choice in (ExampleChoice(), ExampleChoice(count=2)):
        with pytest.raises(OutputError, match=r"what --count 1 chose of tiny 1\.0\.0"):
            pull(home, here, choice=choice)
        assert contents(here) == before
    pull(home, here, replace=True)
    assert contents(here) == contents(home)
    with pytest.raises(OutputError, match="got the whole of tiny"):
        pull(home, here, choice=ExampleChoice(count=2))


def test_an_interrupted_choice_keeps_its_shards(home: Path, tmp_path: Path) -> None:
    def cut(name: str, start: int, data: bytes) -> bytes:
        if "test-000000" in name and name.endswith(".tar"):
            raise OSError("gone")
        return data

    choice = ExampleChoice(light=("1",))
    with pytest.raises(UserError, match="gone"):
        pull(CountingPlace(home, cut), tmp_path / "here", choice=choice)
    place = CountingPlace(home)
    pull(place, tmp_path / "here", choice=choice)
    assert verify(tmp_path / "here") == []
    assert [piece.name for piece in place.log if "/" in piece.name and "test-000000" not in piece.name] == []


def test_a_wrong_file_is_fetched_again_alone(home: Path, tmp_path: Path) -> None:
    times = dict[int, int]()

    def once(name: str, start: int, data: bytes) -> bytes:
        times[start] = times.get(start, 0) + name.endswith(".tar")
        return bytes([data[0] ^ 1]) + data[1:] if name.endswith(".tar") and times[start] == 1 else data

    place = CountingPlace(home, once)
    pulled = pull(place, tmp_path / "here", choice=ExampleChoice(object=("test-chair-02",), layers=("mask",)))
    assert verify(tmp_path / "here") == []
    assert pulled.wanted < place.fetched(".tar") < 2 * pulled.wanted + 20_000
    always = CountingPlace(home, lambda name, start, data: data[:-1] + b"x" if name.endswith(".tar") else data)
    with pytest.raises(UserError, match=r"0000000\d\.preview\.png: expected SHA-256 .* differed 3 times"):
        pull(always, tmp_path / "there", choice=ExampleChoice(object=("test-chair-02",), layers=("mask",)))


def test_a_subset_of_a_subset(home: Path, tmp_path: Path) -> None:
    pull(home, tmp_path / "half", choice=ExampleChoice(split=("train",)))
    pull(tmp_path / "half", tmp_path / "less", choice=ExampleChoice(level=("fine",)))
    assert verify(tmp_path / "less") == []
    record = load_manifest(tmp_path / "less").subset
    assert record is not None
    assert (record.sha256, record.examples) == (sha256_file(tmp_path / "half/dataset.json"), 8)


def test_a_newer_version_of_a_choice(home: Path, tmp_path: Path) -> None:
    choice = ExampleChoice(level=("fine",))
    pull(home, tmp_path / "here", choice=choice)
    plain = examples()
    newer = made(tmp_path / "newer/tiny", chosen={**plain, 3: examples()[3]})
    place = CountingPlace(newer)
    assert pull(place, tmp_path / "here", choice=choice).moved == 0


def test_sources_and_rejected_examples_are_those_of_what_is_there(home: Path, tmp_path: Path) -> None:
    shutil.copytree(home, tmp_path / "there")

    def add(content: dict[str, Any]) -> None:
        part = {"source": "stool", "licence": "CC0-1.0"}
        content["parts"] = [
            {"kind": "procedural", **part, "objects": ["train-chair-00", "train-stool-00"]},
            {"kind": "procedural", "source": "cabinet", "licence": "CC0-1.0", "objects": ["train-cabinet-00"]},
            {"kind": "procedural", **part, "licence": "MIT", "objects": ["train-chair-00"]},
            {"kind": "thing", "source": "flat.usd", "licence": "MIT", "objects": ["train-chair-00"]},
            {"kind": "file", "source": "sofa.obj", "licence": "MIT", "objects": ["train-sofa-00"]}]
        rejected = [("00000100", "train/000001"), ("00000101", "train/000099"), ("00000102", "test/000004")]
        content["rejected"] = [{"key": key, "view": view, "gate": "mask", "reason": "none"} for key, view in rejected]
        content["totals"]["rejected"] = 3

    edit(tmp_path / "there/dataset.json", add)
    pull(tmp_path / "there", tmp_path / "train", choice=ExampleChoice(split=("train",)))
    pull(tmp_path / "there", tmp_path / "chair", choice=ExampleChoice(object=("train-chair-00",)))
    assert verify(tmp_path / "train") == verify(tmp_path / "chair") == []
    train, chair = load_manifest(tmp_path / "train"), load_manifest(tmp_path / "chair")
    assert [part.objects for part in train.parts] == [
        ("train-chair-00", "train-stool-00"), ("train-cabinet-00",), ("train-chair-00",)]
    assert [(part.source, part.objects) for part in chair.parts] == [
        ("stool", ("train-chair-00",)), ("cabinet", ("train-cabinet-00",)), ("flat.usd", ("train-chair-00",))]
    assert [item.key for item in train.rejected] == ["00000100", "00000101"]
    assert [item.key for item in chair.rejected] == ["00000100"]


def test_an_example_with_fewer_layers_is_known_by_another_digest(home: Path, tmp_path: Path) -> None:
    """So that no build takes it for the whole one."""
    pull(home, tmp_path / "here", choice=ExampleChoice(layers=("mask",)))

    def digests(folder: Path) -> set[str]:
        return {example["digest"] for path in (folder / "index").iterdir()
                for example in json.loads(path.read_text())["examples"]}

    assert len(digests(tmp_path / "here")) == len(digests(home)) == 12
    assert not digests(tmp_path / "here") & digests(home)
