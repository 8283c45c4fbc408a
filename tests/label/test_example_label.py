"""Labels come back as they were written, older and newer ones are read, and damage is told by its place."""

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import ValidationError

from dataset_builder.errors import ShardError
from dataset_builder.label.example_label import ExampleLabel, LayerAccuracy, PassRecord, RenderRecord
from dataset_builder.layers import LAYERS, Pass
from dataset_builder.seeding import rng
from dataset_builder.shards.example import label
from dataset_builder.shards.label_text import MOST_BYTES, encode_label, parse_label
from dataset_builder.shards.reader import open_dataset
from tests.plans import render_record
from tests.shards.tiny_dataset import make_example


def plain() -> dict[str, Any]:
    """A label as plain data."""
    example = make_example(3)
    return json.loads(encode_label(label(example, example.layers)))


def test_the_labels_of_a_built_dataset_come_back_byte_for_byte(small_dataset: Path) -> None:
    dataset = open_dataset(small_dataset, layers=())
    for key in (key for keys in dataset.splits.values() for key in keys):
        written = encode_label(dataset[key]["meta"])
        assert encode_label(parse_label(written, where="", name=key)) == written
        assert dataset.label(key).model_dump(mode="json") == dataset[key]["meta"]


def test_every_double_comes_back() -> None:
    """Any 64 bits that are a finite number, in the place of a coefficient."""
    values = [value for (value,) in struct.iter_unpack("<d", rng(0).bytes(80000)) if value - value == 0]
    content = plain()
    content["record"]["lighting_sh"] = [values[start:start + 3] for start in range(0, len(values) - 2, 3)]
    written = encode_label(content)
    assert len(values) > 9000 and encode_label(parse_label(written, where="", name="")) == written


@pytest.mark.parametrize("path", ["record.lighting_sh", "record.lighting_sh_se", "record.denoised",
                                  "record.bounding_radius", "record.roughness", "plan.fog", "plan.render.denoise",
                                  "plan.room.glazing"])
def test_labels_of_earlier_versions_are_read(path: str) -> None:
    content, whole = plain(), parse_label(encode_label(plain()), where="", name="")
    *above, last = path.split(".")
    holder = content
    for part in above:
        holder = holder[part]
    del holder[last]
    found = parse_label(encode_label(content), where="", name="")
    assert found.plan.rough == whole.plan.rough and found.record.passes == whole.record.passes


def test_keys_of_later_versions_are_passed_over() -> None:
    content, whole = plain(), plain()
    for holder in (content, content["plan"], content["record"]["passes"][0], content["layers"]["mask"]):
        holder["added_later"] = {"a": 1}
    assert parse_label(encode_label(content), where="", name="") == ExampleLabel.model_validate(whole)


@pytest.mark.parametrize(("change", "said"), [
    (lambda content: content.pop("plan"), "plan: Field required"),
    (lambda content: content["plan"]["rough"].pop("level"), "plan.rough.level: Field required"),
    (lambda content: content["plan"]["rough"].update(level="x"), "plan.rough.level: Input should be a valid integer"),
    (lambda content: content["record"]["passes"][0].update(name="x"), "record.passes.0.name: Input should be "),
    (lambda content: content.update(layers=[]), "layers: Input should be an object"),
    (lambda content: content["layers"]["mask"].pop("max"), "layers.mask.max: Field required"),
])
def test_damage_is_told_with_its_place(change: Callable[[dict[str, Any]], object], said: str) -> None:
    content = plain()
    change(content)
    with pytest.raises(ShardError) as caught:
        parse_label(encode_label(content), where="a.tar", name="00000003.json")
    problem, = caught.value.problems
    assert str(problem).startswith(f"a.tar: 00000003.json: {said}")


@pytest.mark.parametrize("data", [b"{", b"", b"[]", b"\xff", b"[" * 100000, b" " * (MOST_BYTES + 1)], ids=range(6))
def test_what_is_no_label_is_refused(data: bytes) -> None:
    with pytest.raises(ShardError, match=r"^x\.tar: y\.json: (Invalid JSON|Input should|expected (JSON|a file of))"):
        parse_label(data, where="x.tar", name="y.json")


def test_a_built_label_has_every_key(small_dataset: Path) -> None:
    record = open_dataset(small_dataset, layers=())["00000000"]["meta"]["record"]
    assert set(record) == set(RenderRecord.model_fields)
    assert all(set(entry) == set(PassRecord.model_fields) for entry in record["passes"])
    assert record["layers"] and all(set(entry) == set(LayerAccuracy.model_fields) for entry in record["layers"])


def test_the_figures_of_a_build_fit_together(small_dataset: Path) -> None:
    label = open_dataset(small_dataset, layers=()).label("00000000")
    record, shipped = label.record, dict(label.plan.render.layers)
    assert tuple(entry.name for entry in record.passes) == get_args(Pass)
    for entry in record.passes:
        assert entry.spp_min <= entry.spp <= entry.spp_max
        assert entry.paths == pytest.approx(entry.spp * entry.pixels)
    assert [entry.name for entry in record.layers] == [name for name in shipped if LAYERS[name].radiometric]
    assert 0 < record.roughness_rms < record.roughness_max < 1 and record.bounding_radius > 0
    rough, = record.roughness
    assert rough.to_clean_rms < record.roughness_max * 1.01 and rough.area == pytest.approx(1, abs=0.01)
    assert 0 < rough.silhouette_iou <= 1 and len(rough.s_relmse) == 1
    assert len(record.lighting_sh) == len(record.lighting_sh_se) == 9 and max(record.lighting_sh[0]) > 0


def test_a_pass_that_was_not_needed_has_zeros() -> None:
    assert PassRecord(name="rough").model_dump() == {"name": "rough", "pixels": 0, "spp": 0.0, "spp_min": 0,
                                                     "spp_max": 0, "paths": 0}


@pytest.mark.parametrize("figures", [{"roughness_rms": float("nan")}, {"seconds": 1.0},
                                     {"lighting_sh": [(1.0, 2.0)]}, {"layers": [{"name": "i_t"}]}])
def test_wrong_records_are_not_made(figures: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        render_record(**figures)
    assert isfinite(render_record().roughness_rms)


def test_an_error_that_is_not_known_is_no_value_of_a_label() -> None:
    example = make_example()
    unknown = LayerAccuracy(name="i_t", stopped="spp", relative_error=float("inf"), relative_error_95=float("nan"),
                            object_relative_error=0.0, object_relative_error_95=0.0)
    record = example.record.model_copy(update={"layers": (unknown,)})
    with pytest.raises(ShardError, match=r"record\.layers\[\]\.relative_error: expected .* a finite float"):
        encode_label(label(replace(example, record=record), example.layers))
