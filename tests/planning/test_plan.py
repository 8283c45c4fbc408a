from collections.abc import Callable
from typing import Any

import pytest
from pydantic import ValidationError

from dataset_builder.errors import PlanError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import LAYERS
from dataset_builder.planning.plan import Planner, plan_example
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.scene import ObjectSpec

Load = Callable[..., LoadedSpec]


def plan_all(loaded: LoadedSpec) -> list[ExamplePlan]:
    planner = Planner(loaded)
    return [planner.example(ref) for ref in planner.examples]


def plans_by_place(loaded: LoadedSpec) -> dict[tuple[str, int, int], ExamplePlan]:
    return {(plan.view, plan.light, plan.rough.level): plan for plan in plan_all(loaded)}


def drawn(plan: ExamplePlan) -> dict[str, Any]:
    """All but the numbering."""
    return plan.model_dump(exclude={"key", "index"})


def test_an_example_alone_is_the_one_in_the_whole(load: Load) -> None:
    loaded = load()
    whole = plan_all(loaded)
    assert [plan.index for plan in whole] == list(range(len(whole))) and len(whole) == 52
    for index in (0, 7, 21, 51):
        assert plan_example(loaded, index) == whole[index]
    planner = Planner(loaded)
    assert [plan_example(loaded, index, planner) for index in (51, 7, 0)] == [whole[index] for index in (51, 7, 0)]


def test_plans_are_json_and_back(load: Load) -> None:
    plan = plan_example(load(), 7)
    assert ExamplePlan.model_validate_json(plan.model_dump_json()) == plan
    assert plan.key == "00000007" and plan.schema_version == "1.0.0"


def test_examples_of_a_view_share_all_but_light_and_level(load: Load) -> None:
    first, *others = plan_all(load())[:4]
    assert [(plan.light, plan.rough.level) for plan in (first, *others)] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    for other in others:
        for name in ("view", "room", "target", "furniture", "camera", "source_light", "render"):
            assert getattr(first, name) == getattr(other, name)
    assert others[0].target_light == first.target_light != others[1].target_light
    assert others[1].rough == first.rough != others[0].rough and others[0].rough.sigma == 0


def test_more_lights_levels_splits_and_objects_move_no_other_draw(load: Load, dataset_data: dict[str, Any]) -> None:
    before = plans_by_place(load())
    dataset_data["rough"]["sigma"] = [*dataset_data["rough"]["sigma"], 0.02]
    dataset_data["splits"][0]["lights"] = 3
    dataset_data["splits"].append({**dataset_data["splits"][1], "name": "more"})
    after = plans_by_place(load(dataset_data))
    assert len(after) > len(before)
    for place, plan in before.items():
        assert drawn(after[place]) == drawn(plan)


def test_another_camera_spec_leaves_objects_layout_and_noise_alone(load: Load, dataset_data: dict[str, Any]) -> None:
    before = plan_example(load(), 3)
    dataset_data["camera"]["fov"] = 60
    after = plan_example(load(dataset_data), 3)
    assert after.camera != before.camera
    for name in ("room", "target", "furniture", "rough", "source_light", "render"):
        assert getattr(before, name) == getattr(after, name)


def test_the_seed_moves_everything_and_zero_is_a_seed(load: Load, dataset_data: dict[str, Any]) -> None:
    plans = [plan_example(load(dataset_data | {"seed": seed}), 0) for seed in (0, 1, 0)]
    assert plans[0] == plans[2]
    assert plans[0].target != plans[1].target and plans[0].render.seed != plans[1].render.seed


def test_one_furniture_more_leaves_the_target_and_what_stands_already(load: Load, scene_data: dict[str, Any]) -> None:
    before = plan_example(load(), 0)
    scene_data["furniture"].append({"object": "stool.yaml", "place": "floor"})
    after = plan_example(load(scene=scene_data), 0)
    assert after.target == before.target and after.furniture[:len(before.furniture)] == before.furniture


def test_instances_count_from_the_target(load: Load) -> None:
    for plan in plan_all(load()):
        assert plan.target.instance == 1
        assert [piece.instance for piece in plan.furniture] == list(range(3, 3 + len(plan.furniture)))


def test_render_numbers_come_from_the_spec_alone(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["render"] = {"spp": {"first_hit": 16, "source": 32, "target": 64, "rough": 128}, "batches": 8,
                              "max_depth": 3, "rr_depth": 2}
    dataset_data["image"] = {"width": 64, "height": 32}
    render = plan_example(load(dataset_data), 0).render
    assert (render.spp_first_hit, render.spp_source, render.spp_target, render.spp_rough) == (16, 32, 64, 128)
    assert (render.batches, render.rr_depth) == (8, 2)
    assert (render.width, render.height) == (64, 32)


def test_standard_errors_come_with_every_radiometric_layer(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["layers"] = {"i_s": "frame", "d": "object", "s_prime": "object", "s_prime_se": "frame"}
    plain = plan_example(load(dataset_data), 0).render.layers
    assert plain == (("i_s", "frame"), ("d", "object"), ("s_prime", "object"), ("s_prime_se", "frame"))
    dataset_data["storage"] = {"standard_errors": True}
    layers = plan_example(load(dataset_data), 0).render.layers
    assert layers == (*plain, ("i_s_se", "frame"))
    assert all(name in LAYERS for name, _ in layers)


def test_an_example_out_of_range_is_an_error(load: Load) -> None:
    for index in (-1, 52):
        with pytest.raises(PlanError, match=rf"expected an example in \[0, 52\), got {index}"):
            plan_example(load(), index)


def test_a_target_too_large_for_its_room_is_an_error(load: Load) -> None:
    loaded = load(room={"width": 3, "depth": 3, "height": 1.5},
                  objects={name: ObjectSpec(family="wardrobe") for name in ("chair.yaml", "stool.yaml")})
    with pytest.raises(PlanError, match=r"expected the target to fit in the room, .* of 3\.00 x 3\.00 x 1\.50"):
        plan_example(loaded, 0)


def test_a_camera_that_can_never_see_the_object_is_an_error(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["camera"] = {"coverage": (0.9, 1.0), "visibility": 1, "attempts": 15}
    with pytest.raises(PlanError, match=r"train/000000 \(train-\w+-0\d in train-room-0\d\): camera: .* in 15 draws"):
        plan_example(load(dataset_data), 0)


THREE = {"batches": 3, "spp": {"source": 9, "target": 9, "rough": 9}}


@pytest.mark.parametrize(("render", "got"), [(THREE, "3 batches"), ({"denoise": {"layers": ["i_t"]}}, "i_t denoised")])
def test_halves_are_refused_where_there_are_no_two(load: Load, dataset_data: dict[str, Any], render: dict[str, Any],
                                                   got: str) -> None:
    dataset_data["layers"] = {"i_t": "object", "i_t_half": "object"}
    assert plan_example(load(dataset_data), 0).render.layers == (("i_t", "object"), ("i_t_half", "object"))
    dataset_data["render"] = render
    with pytest.raises(ValidationError, match=f"an even number of batches and i_t as it was sampled, got {got}"):
        load(dataset_data)
