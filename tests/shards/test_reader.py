import pickle
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.digest import canonical_json, sha256_bytes
from dataset_builder.errors import ShardError
from dataset_builder.shards import exr, member_bytes
from dataset_builder.shards.reader import Dataset, Verify, open_dataset
from tests.plans import PAPER
from tests.shards.replaced import exr_of, replace_members
from tests.shards.tiny_dataset import default_examples, index_path, shard_path

STEM = "tiny-v1-train-000000"
TAGGED = f"{STEM}-[0-9a-f]{{8}}"


def flip_a_bit(folder: Path, key: str, layer: str) -> None:
    """Change the key that a file's header states: the pixels still decode, so only hashes can tell."""
    path = shard_path(folder, STEM)
    data = path.read_bytes()
    start = data.index(f"{key}.{layer}.exr".encode())
    at = data.index(b"3df-lighting:schema\0string\0", start) + len(b"3df-lighting:schema\0string\0") + 4
    path.write_bytes(data[:at] + b"9" + data[at + 1:])


@pytest.mark.parametrize(("text", "reason"), [
    (b"", "an empty file"), (b" <!DOCTYPE html><title>Log in", "begins with '<!DOCTYPE html>.*a page of a server")])
def test_what_lies_in_place_of_a_dataset_is_named(dataset: Path, text: bytes, reason: str) -> None:
    (dataset / "dataset.json").write_bytes(text)
    with pytest.raises(ShardError, match=f"dataset.json: expected JSON, got .*{reason}"):
        open_dataset(dataset)


@pytest.mark.parametrize("verify", ["off", "size", "shard", "member"])
def test_every_example_comes_back(dataset: Path, verify: Verify) -> None:
    data, examples = open_dataset(dataset, verify=verify), default_examples()
    assert len(data) == 4 and [item["meta"]["key"] for item in data] == [examples[i].key for i in range(4)]
    for index, example in examples.items():
        item = data[f"{index:08d}"]
        assert set(item) == {*example.layers, "meta"}
        assert all(np.array_equal(item[name], array) for name, array in example.layers.items())
        assert item["meta"]["plan"]["rough"]["sigma"] == 0.004


def test_examples_are_found_by_split_and_position(dataset: Path) -> None:
    data = open_dataset(str(dataset))
    assert data.splits == {"train": ("00000000", "00000001", "00000002"), "test": ("00000003",)}
    assert data["train", 2]["meta"]["key"] == "00000002" and data["test", -1]["meta"]["key"] == "00000003"
    with pytest.raises(IndexError):
        data["test", 1]
    with pytest.raises(KeyError):
        data["00000009"]


def test_layers_that_are_not_chosen_are_not_decoded(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    decoded, read = [], exr.read

    def count(data: bytes, *, where: str, most: int) -> exr.ExrImage:
        decoded.append(where)
        return read(data, where=where, most=most)

    monkeypatch.setattr(exr, "read", count)
    item = open_dataset(dataset, layers=["i_s", "mask"])["00000002"]
    assert set(item) == {"i_s", "mask", "meta"} and decoded == ["00000002.i_s.exr", "00000002.mask.exr"]
    assert set(open_dataset(dataset, layers=[])["00000002"]) == {"meta"}
    assert set(open_dataset(dataset, layers=["mask"], label=False)["00000002"]) == {"mask"}


def test_unknown_layers_are_refused(dataset: Path) -> None:
    with pytest.raises(ShardError, match="got albedo"):
        open_dataset(dataset, layers=["albedo"])


def test_changed_bytes_pass_off_and_size_and_nothing_else(dataset: Path) -> None:
    flip_a_bit(dataset, "00000001", "d")
    for verify in ("off", "size"):
        assert open_dataset(dataset, verify=verify)["00000001"]["d"].shape == (6, 8, 3)
    with pytest.raises(ShardError, match=r"expected SHA-256 .* of 00000001\.d\.exr"):
        open_dataset(dataset, verify="member")["00000001"]
    assert open_dataset(dataset, verify="member")["00000000"]
    with pytest.raises(ShardError, match=rf"{TAGGED}\.tar: expected SHA-256"):
        open_dataset(dataset, verify="shard")["00000000"]
    assert open_dataset(dataset, verify="shard")["00000003"]


def test_a_cut_shard_is_refused_when_opened_or_at_the_latest_when_read(dataset: Path) -> None:
    path = shard_path(dataset, STEM)
    whole = path.read_bytes()
    path.write_bytes(whole[:15 * 512])
    with pytest.raises(ShardError, match=f"expected {len(whole)} bytes, got 7680"):
        open_dataset(dataset)
    with pytest.raises(ShardError, match="the file ends after"):
        list(open_dataset(dataset, verify="off"))


@pytest.mark.parametrize("verify", ["off", "size"])
def test_never_fewer_examples_without_an_error(dataset: Path, verify: Verify) -> None:
    index = index_path(dataset, STEM)
    text = index.read_text()
    index.write_text(text.replace('"view":"train/000000"', '"view":"x"', 1).replace('"examples":2', '"examples":1'))
    with pytest.raises(ShardError, match=r"expected the index of 2 examples"):
        open_dataset(dataset, verify=verify)
    index.write_text(text.replace('"key":"00000001"', '"key":"00000000"').replace('"name":"00000001.',
                                                                                  '"name":"00000000.'))
    with pytest.raises(ShardError, match=r"expected (4 examples, the indexes hold 3|SHA-256)"):
        open_dataset(dataset, verify=verify)
    index.unlink()
    with pytest.raises(ShardError, match="expected a file, found none"):
        open_dataset(dataset, verify=verify)


def test_an_unfinished_dataset_is_not_opened(dataset: Path) -> None:
    (dataset / "dataset.json").unlink()
    with pytest.raises(ShardError, match="expected a finished dataset"):
        open_dataset(dataset)


def test_all_layers_are_read_by_default(dataset: Path) -> None:
    assert open_dataset(dataset).layers == tuple(name for name, _ in PAPER)


@pytest.mark.parametrize("verify", ["off", "size", "shard", "member"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_pixels_that_are_not_finite_are_refused_though_every_hash_is_right(dataset: Path, verify: Verify,
                                                                           value: float) -> None:
    pixels = default_examples()[1].layers["d"].copy()
    pixels[3, 4, 2] = value
    replace_members(dataset, {"00000001.d.exr": exr_of(pixels, layer="d", key="00000001")})
    data = open_dataset(dataset, verify=verify)
    rule = rf"{TAGGED}\.tar: 00000001\.d\.exr: expected finite values, got 1 that are NaN"
    with pytest.raises(ShardError, match=rule):
        data["00000001"]
    assert data["00000000"] and open_dataset(dataset, layers=["i_s", "r"], verify=verify)["00000001"]


def test_large_values_are_finite(dataset: Path) -> None:
    pixels = np.full((6, 8, 3), np.finfo(np.float32).max, np.float32)
    replace_members(dataset, {"00000003.i_t.exr": exr_of(pixels, layer="i_t", key="00000003")})
    assert np.array_equal(open_dataset(dataset)["00000003"]["i_t"], pixels)


def test_pictures_of_another_size_are_refused(dataset: Path) -> None:
    replace_members(dataset, {"00000002.r.exr": exr_of(np.zeros((6, 9, 3)), layer="r", key="00000002")})
    with pytest.raises(ShardError, match=r"00000002\.r\.exr: expected .* columns \(3, 6, 8\), got \(3, 6, 9\)"):
        open_dataset(dataset)["00000002"]


def test_labels_alone_and_layers_alone(dataset: Path) -> None:
    data = open_dataset(dataset, layers=["mask", "i_s"])
    whole = data["00000002"]
    assert data.label("00000002").model_dump(mode="json") == whole["meta"]
    images = dict(data.images("00000002"))
    assert list(images) == ["mask", "i_s"] and [len(image.planes) for image in images.values()] == [1, 3]
    assert all(np.array_equal(image.pixels, whole[name]) for name, image in images.items())


def test_a_label_that_is_no_json_is_told_apart(dataset: Path) -> None:
    replace_members(dataset, {"00000000.json": b"{"})
    with pytest.raises(ShardError, match=r"expected JSON in 00000000\.json"):
        open_dataset(dataset)["00000000"]
    with pytest.raises(ShardError, match=rf"{TAGGED}\.tar: 00000000\.json: Invalid JSON: EOF"):
        open_dataset(dataset).label("00000000")


def test_a_shard_that_went_away_is_told(dataset: Path) -> None:
    data = open_dataset(dataset)
    shard_path(dataset, STEM).unlink()
    with pytest.raises(ShardError, match=rf"{TAGGED}\.tar: cannot be read"):
        data["00000000"]


def test_a_process_is_handed_a_dataset(dataset: Path) -> None:
    data = open_dataset(dataset, layers=["d"])
    again = pickle.loads(pickle.dumps(data))
    assert again.splits == data.splits and np.array_equal(again["00000003"]["d"], data["00000003"]["d"])


@pytest.mark.parametrize(("layer", "key"), [("r", "00000001"), ("d", "00000002")])
@pytest.mark.parametrize("verify", ["off", "member"])
def test_a_layer_of_another_name_or_example_is_refused(dataset: Path, layer: str, key: str, verify: Verify) -> None:
    pixels = default_examples()[1].layers["d"]
    replace_members(dataset, {"00000001.d.exr": exr_of(pixels, layer=layer, key=key)})
    with pytest.raises(ShardError, match=f"expected layer d of example 00000001, its header says '{layer}' of '{key}'"):
        open_dataset(dataset, verify=verify)["00000001"]


def test_a_label_of_another_example_is_refused(dataset: Path) -> None:
    other = canonical_json(open_dataset(dataset)["00000001"]["meta"])
    replace_members(dataset, {"00000000.json": other})
    with pytest.raises(ShardError, match=r"00000000\.json: expected the label of example 00000000, got '00000001'"):
        open_dataset(dataset)["00000000"]
    with pytest.raises(ShardError, match=r"00000000\.json: expected the label of example 00000000, got '00000001'"):
        open_dataset(dataset).label("00000000")


def test_members_are_hashed_when_first_read_and_not_again(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hashed = []

    def counted(data: bytes) -> str:
        hashed.append(data)
        return sha256_bytes(data)

    monkeypatch.setattr(member_bytes, "sha256_bytes", counted)
    data = open_dataset(dataset, layers=["d", "r"])
    assert not hashed
    data["00000001"], data["00000001"]
    assert len(hashed) == 3


def test_a_manifest_or_index_of_other_bytes_is_refused(dataset: Path) -> None:
    for path, old, new in ((dataset / "dataset.json", b'"title":"Tiny"', b'"title":"Tinx"'),
                           (index_path(dataset, STEM), b'"view":"train/000000"', b'"view":"train/000001"')):
        whole = path.read_bytes()
        path.write_bytes(whole.replace(old, new))
        with pytest.raises(ShardError, match=f"{path.name}: expected SHA-256"):
            open_dataset(dataset)
        assert open_dataset(dataset, verify="off")
        path.write_bytes(whole)
    assert open_dataset(dataset)


def test_a_key_is_known_without_reading_anything(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = open_dataset(dataset)
    monkeypatch.setattr(Dataset, "__getitem__", None)
    key = found.splits["train"][0]
    assert key in found and "99999999" not in found and 0 not in found


def test_arguments_that_mean_nothing_are_refused(dataset: Path) -> None:
    with pytest.raises(ShardError, match="expected verify to be one of off, size, shard, member, got 'x'"):
        open_dataset(dataset, verify="x")  # type: ignore[arg-type]
    one = open_dataset(dataset, layers="i_t")  # type: ignore[arg-type]
    assert one.layers == ("i_t",) and open_dataset(dataset, layers=(name for name in ["i_t"])).layers == ("i_t",)
