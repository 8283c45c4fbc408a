"""The record of a real build has every key of its model, and figures that fit together."""

from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import get_args

import pytest
from pydantic import ValidationError

from dataset_builder.errors import ShardError
from dataset_builder.label.record import LayerAccuracy, PassRecord, RenderRecord
from dataset_builder.layers import LAYERS, Pass
from dataset_builder.shards.example import label
from dataset_builder.shards.label_text import encode_label
from dataset_builder.shards.reader import open_dataset
from tests.plans import render_record
from tests.shards.tiny_dataset import make_example


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
