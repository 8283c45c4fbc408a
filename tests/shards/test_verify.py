import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.digest import canonical_json, sha256_bytes, sha256_file
from dataset_builder.shards.folder import CARD, CROISSANT, SUMS
from dataset_builder.shards.label_text import encode_label
from dataset_builder.shards.manifest import from_json
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.structure import tar_problems
from dataset_builder.shards.verify import verify
from tests.shards.replaced import replace_members
from tests.shards.tiny_dataset import build, default_examples, index_path, make_example, make_layers, shard_path

STEM = "tiny-v1-train-000000"


def found(folder: Path) -> str:
    return "\n".join(map(str, verify(folder)))


def load_index(folder: Path, stem: str = STEM) -> ShardIndex:
    return from_json(ShardIndex, index_path(folder, stem).read_bytes(), where=stem)


def edit(path: Path, change: Callable[[Any], None]) -> None:
    """Change a JSON file and seal it again: SHA256SUMS follows, so that only its meaning can be found wrong."""
    content = json.loads(path.read_bytes())
    change(content)
    path.write_bytes(canonical_json(content) + b"\n")
    reseal(path.parent if path.name == "dataset.json" else path.parent.parent)


def reseal(folder: Path) -> None:
    names = [line.split("  ")[1] for line in (folder / SUMS).read_text().splitlines()]
    (folder / SUMS).write_text("".join(f"{sha256_file(folder / name)}  {name}\n" for name in names))


def test_a_good_dataset_has_no_problem(dataset: Path) -> None:
    assert verify(dataset) == []


@pytest.mark.parametrize("dtype", ["float32", "float16"])
def test_both_storage_types_verify(tmp_path: Path, dtype: Any) -> None:
    build(tmp_path / "out", dtype=dtype)
    assert verify(tmp_path / "out") == []


def test_a_shard_cut_at_any_block_is_found(dataset: Path) -> None:
    path, index = shard_path(dataset, STEM), load_index(dataset)
    whole = path.read_bytes()
    for size in range(0, len(whole), 512):
        path.write_bytes(whole[:size])
        assert tar_problems(path, index), size
        if size % 5120 == 0:
            text = found(dataset)
            assert f"expected {len(whole)} bytes, got {size}" in text and "expected SHA-256" in text


def test_a_flipped_bit_in_any_byte_of_a_header_is_found_by_structure_alone(dataset: Path) -> None:
    path, index = shard_path(dataset, STEM), load_index(dataset)
    whole = path.read_bytes()
    start = index.examples[1].members[2].offset - 512
    for at in range(start, start + 512):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << at % 8]) + whole[at + 1:])
        problem, = tar_problems(path, index)
        assert "tar header" in problem.rule


def test_a_flipped_bit_in_payload_padding_or_end_is_found(dataset: Path) -> None:
    path, index = shard_path(dataset, STEM), load_index(dataset)
    whole, member = path.read_bytes(), index.examples[0].members[1]
    for at in (*range(member.offset, member.offset + member.size + 1, 13), member.offset + member.size, len(whole) - 1):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 16]) + whole[at + 1:])
        assert len(tar_problems(path, index)) == 1
    text = found(dataset)
    assert "end blocks" in text and "expected SHA-256" in text


def test_bytes_after_the_end_are_found(dataset: Path) -> None:
    with shard_path(dataset, STEM).open("ab") as stream:
        stream.write(b"more")
    assert "nothing but end blocks" in found(dataset)


def test_missing_extra_and_renamed_files_are_found(dataset: Path) -> None:
    gone, test = shard_path(dataset, STEM), index_path(dataset, "tiny-v1-test-000000")
    gone.rename(shard_path(dataset, "tiny-v1-train-000007"))
    (dataset / "notes.txt").write_text("x")
    test.unlink()
    (dataset / "previews").mkdir()
    (dataset / "previews" / "sheet.png").write_bytes(b"ignored")
    text = found(dataset)
    assert f"shards/{gone.name}: expected a file, found none" in text
    assert "shards/tiny-v1-train-000007.tar: expected only files" in text
    assert f"index/{test.name}: expected a file, found none" in text
    assert "notes.txt: expected only files" in text and "sheet.png" not in text


def test_a_shard_in_the_place_of_another_is_found(dataset: Path) -> None:
    shutil.copy(shard_path(dataset, "tiny-v1-test-000000"), shard_path(dataset, "tiny-v1-train-000001"))
    text = found(dataset)
    assert f"{shard_path(dataset, 'tiny-v1-train-000001').name}: expected SHA-256" in text and "00000002.d.exr" in text


def test_a_shard_listed_twice_is_found(dataset: Path) -> None:
    edit(dataset / "dataset.json", lambda content: content["shards"].append(content["shards"][0]))
    text = found(dataset)
    assert f"got 2 of name {shard_path(dataset, STEM).name}" in text and "got 2 of content" in text
    assert "00000000: expected each key once, got 2" in text and "totals" in text and "splits.train" in text


def test_wrong_hashes_and_lines_in_the_sums_are_found(dataset: Path) -> None:
    lines = (dataset / SUMS).read_text().splitlines()
    lines[0] = "0" * 64 + lines[0][64:]
    (dataset / SUMS).write_text("\n".join([*lines, "nonsense"]))
    text = found(dataset)
    assert "README.md: expected SHA-256 " + "0" * 64 in text and f"{SUMS}:{len(lines) + 1}" in text
    (dataset / SUMS).write_text("\n".join(lines[1:]))
    assert "expected every file of the dataset once" in found(dataset)


def test_every_problem_is_listed_not_only_the_first(dataset: Path) -> None:
    (dataset / CARD).write_text("changed")
    (dataset / CROISSANT).write_text("{")
    for stem in (STEM, "tiny-v1-test-000000"):
        shard_path(dataset, stem).write_bytes(b"")
    text = found(dataset)
    for name in (CARD, "croissant.json: expected Croissant's JSON", STEM, "tiny-v1-test-000000"):
        assert name in text


def test_a_manifest_that_breaks_its_schema_is_found(dataset: Path) -> None:
    edit(dataset / "dataset.json", lambda content: content.update(surprise=1, width="wide"))
    text = found(dataset)
    assert "surprise" in text and "width" in text
    (dataset / "dataset.json").write_text("{")
    assert "Invalid JSON" in found(dataset)
    (dataset / "dataset.json").unlink()
    assert "expected a finished dataset" in found(dataset)


@pytest.mark.parametrize(("change", "rule"), [
    (lambda index: index["examples"].pop(), "examples: expected 2, got 1"),
    (lambda index: index["examples"].reverse(), "expected keys in order"),
    (lambda index: index["shard"].update(split="test"), "expected what dataset.json says"),
    (lambda index: index["examples"][0]["members"][0].update(pixel_digest="0"), "the digest that the index gives"),
    (lambda index: index["examples"][0]["members"][0].update(pixel_digest="0"), "shared: d: expected the same pixels"),
    (lambda index: index["examples"][0]["members"][5].update(pixel_digest="0"), "preview.png: expected pixels"),
    (lambda index: index["examples"][0]["members"][0].update(sha256="0"), "its bytes differ"),
    (lambda index: index["examples"][0]["members"][0].update(name="00000000.z.exr"), "expected members"),
    (lambda index: index["examples"][0]["members"][0].update(offset=7), "the index says 7"),
    (lambda index: index["examples"][0]["members"].pop(), "expected members"),
    (lambda index: index.pop("versions"), "versions"),
])
def test_an_index_that_is_wrong_but_sealed_is_found(dataset: Path, change: Callable[[Any], None], rule: str) -> None:
    edit(index_path(dataset, STEM), change)
    assert rule in found(dataset)


def spoil(layer: str, at: tuple[int, int], value: float) -> Callable[[dict[str, np.ndarray]], None]:
    def change(layers: dict[str, np.ndarray]) -> None:
        layers[layer][at] = value
    return change


@pytest.mark.parametrize(("change", "rule"), [
    (spoil("r", (2, 3), 0.95), "reflectance: expected d + r <= 1.001"),
    (spoil("i_t", (0, 0), -0.5), "range: i_t: expected values in [0, inf]"),
    (spoil("d", (0, 0), 0.5), "outside: d: expected 0 outside"),
    (spoil("d", (2, 3), 0.5), "shared: d: expected the same pixels"),
    (lambda layers: [array.fill(0) for name, array in layers.items() if name != "i_s"], "mask: expected an object"),
    (lambda layers: layers.pop("s_prime"), "expected members"),
    (lambda layers: layers.update(s=layers["i_t"]), "expected members"),
    (lambda layers: layers.update({name: array[:5].copy() for name, array in layers.items()}), "key, type, shape"),
])
def test_a_dataset_built_whole_of_wrong_examples_is_found(
        tmp_path: Path, change: Callable[[dict[str, np.ndarray]], None], rule: str) -> None:
    layers = make_layers("train/000000", 1)
    change(layers)
    examples = default_examples() | {1: make_example(1, view="train/000000", light=1, layers=layers)}
    build(tmp_path / "out", examples)
    text = found(tmp_path / "out")
    assert rule in text and "00000001" in text
    assert "SHA-256" not in text and "tar header" not in text


def test_labels_whose_keys_vary_are_found(dataset: Path) -> None:
    labels = {key: open_dataset(dataset, layers=[])[key]["meta"] for key in ("00000001", "00000002", "00000003")}
    labels["00000001"]["record"]["passes"][0]["paths"] = "many"
    labels["00000002"]["record"]["extra"] = 1
    labels["00000003"]["record"]["roughness_max"] = 1
    replace_members(dataset, {f"{key}.json": encode_label(label) for key, label in labels.items()})
    text = found(dataset)
    assert "00000001.json: record.passes.0.paths: Input should be a valid integer" in text
    assert "00000002.json: has an extra key `record.extra`, unlike example 00000000" in text
    assert "00000003.json: expected float at `record.roughness_max`, got int" in text


def test_hashes_are_of_what_is_on_disk(dataset: Path) -> None:
    member = load_index(dataset).examples[1].members[3]
    data = shard_path(dataset, STEM).read_bytes()[member.offset:member.offset + member.size]
    assert sha256_bytes(data) == member.sha256 and json.loads(data)["key"] == "00000001"
