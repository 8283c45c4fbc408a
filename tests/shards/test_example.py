import json
from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.digest import pixel_digest
from dataset_builder.errors import ShardError
from dataset_builder.shards import exr
from dataset_builder.shards.example import Example, decode_png, encode_members, preview
from dataset_builder.shards.label_text import KEYS
from tests.shards.tiny_dataset import HEIGHT, WIDTH, make_example


def members_of(example: Example, dtype: exr.DType = "float32") -> dict[str, bytes]:
    members = encode_members(example, dtype=dtype, preview_png=preview(example.layers))
    return {member.name: member.data for member in members}


def test_members_are_sorted_and_fixed() -> None:
    suffixes = ["d.exr", "i_s.exr", "i_t.exr", "json", "mask.exr", "preview.png", "r.exr", "s_prime.exr"]
    assert list(members_of(make_example(42))) == [f"00000042.{suffix}" for suffix in suffixes]


def test_layers_come_back() -> None:
    example = make_example()
    members = members_of(example)
    for name, array in example.layers.items():
        assert np.array_equal(exr.decode(members[f"00000000.{name}.exr"]), array)


def test_the_label_holds_plan_record_and_statistics_as_stored() -> None:
    example = make_example(3, split="test")
    label = json.loads(members_of(example, "float16")["00000003.json"])
    assert set(label) == KEYS and label["plan"] == example.plan.model_dump(mode="json")
    assert label["record"] == example.record.model_dump(mode="json")
    assert (label["key"], label["index"], label["split"]) == ("00000003", 3, "test")
    assert label["plan"]["rough"]["seed"] == "18446744073709551615"
    assert label["layers"]["i_s"]["max"] == float(example.layers["i_s"].max().astype(np.float16))


def test_pixel_digests_are_those_of_what_is_read() -> None:
    example = make_example()
    for member in encode_members(example, dtype="float16", preview_png=preview(example.layers)):
        if member.name.endswith(".exr"):
            assert member.pixel_digest == pixel_digest(exr.decode(member.data))


def test_preview_shows_source_and_target_side_by_side_under_one_exposure() -> None:
    layers = {name: np.full((HEIGHT, WIDTH, 3), value, np.float32) for name, value in (("i_s", 0.25), ("i_t", 4.0))}
    pixels = decode_png(preview(layers))
    assert pixels.shape == (HEIGHT, 2 * WIDTH, 3)
    assert (pixels[:, WIDTH:] == 255).all() and 60 < pixels[0, 0, 0] < 80


def test_preview_of_a_dataset_without_radiance_is_its_first_layer() -> None:
    assert decode_png(preview({"mask": np.ones((2, 3, 1), np.float32)})).shape == (2, 3, 3)


@pytest.mark.parametrize(("layers", "rule"), [
    ({}, "got none"), ({"bloom": np.zeros((2, 2, 3), np.float32)}, "got bloom"),
    ({"i_s": np.zeros((2, 2, 3), np.float32), "mask": np.zeros((2, 3, 1), np.float32)}, "expected one size"),
])
def test_wrong_sets_of_layers_are_refused(layers: dict[str, np.ndarray], rule: str) -> None:
    example = make_example()
    with pytest.raises(ShardError, match=rule):
        encode_members(replace(example, layers=layers), dtype="float32", preview_png=preview(example.layers))
