"""How fields are planned: once per object, whatever is around it; what they give, and what cannot be had of them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import count_examples, examples
from dataset_builder.planning.field_recipe import in_world
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.assets_of_plan import turned_up
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.resolve import LoadedSpec
from tests.plans import example_plan

Load = Callable[..., LoadedSpec]
FIELD = {"kind": "field", "views": 24, "size": 32, "resolution": 32, "steps": 40, "spp": 4}


def seen(data: dict[str, Any], split: int = 1, **source: Any) -> dict[str, Any]:
    data["splits"][split]["source"] = {**FIELD, **source}
    return data


def plans(load: Load, data: dict[str, Any], split: str) -> list[ExamplePlan]:
    planner = Planner(load(data))
    return [planner.example(ref) for ref in planner.examples if ref.view.pair.split == split]


def test_a_split_that_takes_meshes_from_fields_has_one_level(load: Load, dataset_data: dict[str, Any]) -> None:
    before = count_examples(load(dataset_data).dataset)
    spec = load(seen(dataset_data)).dataset
    assert [len(split.levels(spec.rough)) for split in spec.splits] == [2, 1]
    assert count_examples(spec) == len(examples(spec)) == before - 2
    both = load(seen(dataset_data, gives=["i_s"])).dataset
    assert [len(split.levels(both.rough)) for split in both.splits] == [2, 2]


def test_the_field_is_the_objects(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["source"] = {"sun": {"azimuth": {"uniform": [0, 360]}}}
    dataset_data["splits"][1] |= {"objects": {"from": ["chair.yaml"], "count": 2}, "views": 2,
                                  "scenes": {"from": ["scene.yaml"], "count": 2}}
    found = plans(load, seen(dataset_data), "eval")
    by_object = {plan.target.object.name: {each.field for each in found
                                           if each.target.object.name == plan.target.object.name} for plan in found}
    assert len(by_object) == 2 and all(len(fields) == 1 for fields in by_object.values())
    one, two = (fields.pop() for fields in by_object.values())
    assert one.seed != two.seed and one.light.lights[1].direction != two.light.lights[1].direction
    assert all(plan.rough.field == plan.field for plan in found)
    assert {plan.rough.name for plan in found} == {"density-24-32"}
    assert all(plan.field.kind == "none" for plan in plans(load, dataset_data, "train"))


def test_the_source_light_turns_with_the_object(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["source"] = {"sun": {"azimuth": 30, "elevation": 40}}
    for plan in plans(load, seen(dataset_data), "eval"):
        own, world = plan.field.light.lights[1], plan.source_light.lights[1]
        assert np.allclose(turned_up(plan.target.yaw) @ own.direction, world.direction)
        assert plan.field.light.open == () and plan.source_light.open == ("ceiling", "walls")


def test_an_image_turns_with_the_object() -> None:
    light = example_plan().source_light
    sky = light.lights[0].model_copy(update={"turn": 20.0, "image": "sky.hdr"})
    plain = light.lights[0].model_copy(update={"turn": 0.0, "image": ""})
    world = in_world(light.model_copy(update={"lights": (sky, plain)}), 30.0, ("ceiling",))
    assert [each.turn for each in world.lights] == [50.0, 0.0] and world.open == ("ceiling",)


def test_what_is_simulated_of_a_field(load: Load, dataset_data: dict[str, Any]) -> None:
    plan = plans(load, seen(dataset_data), "eval")[0]
    said = {decision.effect: decision for decision in plan.effects.decisions}
    assert said["pass source"].choice == "field" and "volume density" in said["pass source"].reason
    assert "colours" in plan.effects.features and "field" in said["colours"].reason
    assert not any(effect.endswith("of source") for effect in said)
    plain = plans(load, dataset_data, "train")[0]
    assert "colours" not in plain.effects.features


def test_fields_are_levels_after_noise(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["rough"] = {"sigma": [0.001, 0.01], "fields": [{"field": "sdf", "views": 20}, {"views": 50}]}
    found = {plan.rough.level: plan.rough for plan in plans(load, dataset_data, "eval")}
    assert [found[level].field.kind for level in range(4)] == ["none", "none", "sdf", "density"]
    assert [found[level].sigma for level in range(4)] == [0.001, 0.01, 0, 0]
    assert (found[2].field.views, found[3].field.views) == (20, 50)
    dataset_data["rough"] = {"sigma": None, "fields": [{"field": "sdf"}]}
    assert [plan.rough.name for plan in plans(load, dataset_data, "eval")] == ["sdf-100-128"] * 2


@pytest.mark.parametrize(("change", "rule"), [
    ({"layers": {"i_s": "frame"}}, "expected object, since i_s of split eval is the image of a field"),
    ({"render": {"denoise": {"layers": ["i_s"]}}}, "expected no i_s, which is the image of a field"),
    ({"layers": {"i_s_clean": "object"}}, "expected i_s beside it, of the same extent, since both are"),
    ({"layers": {"i_s": "object", "i_s_clean": "frame"}}, "expected i_s beside it"),
])
def test_what_cannot_be_had_is_refused(dataset_data: dict[str, Any], change: dict[str, Any], rule: str) -> None:
    with pytest.raises(ValidationError, match=rule):
        DatasetSpec.model_validate({**seen(dataset_data), **change})


@pytest.mark.parametrize(("source", "rule"), [
    ({"kind": "mesh", "views": 20}, "kind: field"), ({"kind": "field", "views": 5}, "greater than or equal to 8"),
    ({"kind": "field", "spp": 6}, "multiple of 4"), ({"kind": "field", "gives": []}, "at least 1"),
    ({"kind": "field", "gates": {"opacity_iou": 2}}, "less than or equal to 1"),
])
def test_fields_that_make_no_sense_are_refused(dataset_data: dict[str, Any], source: dict[str, Any],
                                               rule: str) -> None:
    dataset_data["splits"][1]["source"] = source
    with pytest.raises(ValidationError, match=rule):
        DatasetSpec.model_validate(dataset_data)
