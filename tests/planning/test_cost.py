from collections.abc import Callable
from dataclasses import astuple, replace
from typing import Any

import pytest

from dataset_builder.errors import PlanError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan, GoalPlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.cost import DIRECT_SHARE, Cost, calibration_cost, estimate, extrapolate, view_cost
from dataset_builder.planning.pass_work import Rates, expected_spp, files_per_example, pass_runs, pass_share
from dataset_builder.planning.plan import Planner, first_plan, plan_example
from dataset_builder.planning.view.visibility import window_share
from dataset_builder.spec.resolve import LoadedSpec

Load = Callable[..., LoadedSpec]
RATES = Rates(light_paths=100.0, free_paths=1000.0, seconds_per_pass=2.0, seconds_per_view=3.0, seconds_per_example=5.0,
              kept_share=0.5, empty_share=0.0, example_bytes=1000.0)


def plan_of(load: Load, data: dict[str, Any], layers: dict[str, str], **render: Any) -> ExamplePlan:
    """A plan of 20 x 10 pixels whose object covers a quarter of them, by camera paths unless asked otherwise."""
    data["image"], data["layers"] = {"width": 20, "height": 10}, layers
    spp = {"first_hit": 2, "source": 4, "target": 8, "rough": 16}
    data["render"] = {"spp": spp, "batches": 4, "transport": "camera"} | render
    plan = plan_example(load(data), 0)
    return plan.model_copy(update={"camera": plan.camera.model_copy(update={"coverage": 0.25})})


def test_the_cost_of_a_view_by_hand(load: Load, dataset_data: dict[str, Any]) -> None:
    """2 lights, 3 levels; the object has 50 pixels and its rectangle 80; i_s on all 200."""
    plan = plan_of(load, dataset_data, {"i_s": "frame", "i_t": "object", "d": "object", "s_prime": "object"})
    cost = view_cost(plan, 2, 3, 0.4, "float32", RATES)
    assert cost.passes == 1 + 2 + 6 + 1 + 6
    assert cost.pixels == pytest.approx(200 + 2 * 50 + 6 * 50 + 80 + 6 * 80)
    lit, free = 200 * 4 + 2 * 50 * 8 + 6 * 50 * 16, 80 * 2 + 6 * 80 * 2
    assert cost.paths == pytest.approx(lit + free)
    fixed = 3 + 6 * 5 + 16 * 2
    assert cost.seconds == pytest.approx(lit / 100 + free / 1000 + fixed)
    assert cost.bytes == pytest.approx(6 * (1000 + 0.5 * 4 * 3 * (200 + 50 + 50 + 50)))
    assert view_cost(plan, 2, 3, 0.4, "float32", RATES, cores=2).seconds == pytest.approx(
        cost.seconds / 2)
    smooth = plan.model_copy(update={"render": plan.render.model_copy(update={"denoise": ("s_prime",)})})
    assert view_cost(smooth, 2, 3, 0.4, "float32", RATES).seconds - cost.seconds == pytest.approx(
        DIRECT_SHARE * 6 * 50 * 16 / 100)


@pytest.mark.parametrize("per_shard", [1, 2, 3, 4, 6, 7, 12, 48, 100])
@pytest.mark.parametrize(("layer", "lights", "levels"), [
    ("d", 2, 3), ("i_s", 2, 3), ("instance", 2, 3), ("i_t", 2, 3), ("i_t", 1, 3), ("s_prime", 2, 3), ("s_se", 3, 2),
    ("i_t_empty", 2, 3), ("i_pbr", 2, 3)])
def test_files_per_example_as_counted(layer: str, lights: int, levels: int, per_shard: int) -> None:
    """Over whole periods of views and shards: a file for every pair of a block of equal examples and a shard."""
    count = lights * levels * per_shard
    block = {"s_prime": 1, "i_pbr": 1, "i_t": levels, "i_t_empty": levels, "s_se": levels}.get(layer, lights * levels)
    files = len({(example // block, example // per_shard) for example in range(count)})
    assert files_per_example(layer, lights, levels, per_shard) == pytest.approx(files / count)


def test_what_a_view_shares_is_counted_once(load: Load, dataset_data: dict[str, Any]) -> None:
    """12 training views of 2 lights and 2 levels, 12 examples a shard; 2 of 1 light and 2 levels, 1 a shard."""
    dataset_data["layers"] = {"i_s": "frame", "i_t": "frame", "s_prime": "frame"}
    sizes = {shared: estimate(Planner(load({**dataset_data, "storage": {"shared": shared, "examples_per_shard": 12}})),
                              views=1000, rates=replace(RATES, example_bytes=0.0)).total.bytes
             for shared in ("each", "once")}
    assert sizes["once"] / sizes["each"] == pytest.approx((48 * (1 / 4 + 1 / 2 + 1) + 4 * 3) / (52 * 3))


def test_what_nobody_asked_for_does_not_run() -> None:
    none = {"source": 0, "source_clean": 0, "target": 0, "rough": 0, "first_hit": 1, "first_hit_rough": 0,
            "instance": 0, "pbr": 0, "empty": 0}
    assert pass_runs([("d", "object")], 4, 3) == none
    assert pass_runs([("i_t", "object")], 4, 3) == none | {"target": 4}
    assert pass_runs([("instance", "object")], 4, 3) == none | {"instance": 1}
    assert pass_runs([("mask_rough", "object")], 4, 3)["first_hit_rough"] == 12
    assert pass_runs([("s_prime_se", "object")], 4, 3)["rough"] == 12
    assert pass_runs([("i_t_empty", "frame")], 4, 3) == none | {"empty": 4}
    assert pass_runs([("i_pbr", "frame")], 4, 3) == none | {"pbr": 12, "first_hit_rough": 12}


def test_masks_and_instances_on_the_frame_leave_the_light_free_passes_at_the_object(
        load: Load, dataset_data: dict[str, Any]) -> None:
    """The rectangle about the object has 80 pixels of 200; instances are one path in each of the 200."""
    plan = plan_of(load, dataset_data, {"mask": "frame", "mask_rough": "frame", "instance": "frame"})
    cost = view_cost(plan, 1, 1, 0.4, "float32", RATES)
    assert (cost.passes, cost.pixels, cost.paths) == (3, pytest.approx(80 + 80 + 200), pytest.approx(2 * 160 + 200))
    assert cost.seconds == pytest.approx((2 * 160 + 200) / 1000 + 3 + 5 + 3 * 2)
    assert pass_share("first_hit", plan_of(load, dataset_data, {"depth": "frame", "mask": "object"}), 0.4) == 1


def test_everything_on_and_guides_trace_the_frame(load: Load, dataset_data: dict[str, Any]) -> None:
    plan = plan_of(load, dataset_data, {"i_s": "frame", "i_t": "object", "d": "object", "mask": "object"})
    assert [pass_share(name, plan, 0.4) for name in ("first_hit", "source", "target")] == [0.4, 1, 0.25]
    denoised = plan_of(load, dataset_data, dict(plan.render.layers), denoise={"layers": ["i_s"]})
    assert [pass_share(name, denoised, 0.4) for name in ("first_hit", "source", "target")] == [1, 1, 0.25]
    whole = plan_of(load, dataset_data, {"i_t": "object", "mask": "object"}, effects="all")
    assert [pass_share(name, whole, 0.4) for name in ("first_hit", "target")] == [1, 1]


def test_goals_end_with_their_error_their_seconds_or_their_cap(load: Load, dataset_data: dict[str, Any]) -> None:
    plan = plan_of(load, dataset_data, {"i_t": "object", "mask": "object"})
    for error, seconds, cap, spp in ((0.1, 0.0, 1000, 256), (0.1, 2.0, 1000, 100), (0.0, 2.0, 1000, 100),
                                     (0.0, 2.0, 60, 60), (0.0, 0.01, 1000, 8)):
        goal = GoalPlan(layer="i_t", error=error, seconds=seconds, cap=cap)
        assert expected_spp(plan.render.model_copy(update={"goals": (goal,)}), "target", 1.6, 50) == pytest.approx(spp)
    # 50 pixels, 100 paths a second: 4 more seconds than with the 8 spp of the first round, which take 4
    goal = GoalPlan(layer="i_t", error=0.0, seconds=8.0, cap=1000)
    timed = plan.model_copy(update={"render": plan.render.model_copy(update={"goals": (goal,)})})
    fixed, ended = (view_cost(each, 1, 1, 0.4, "float32", RATES).seconds for each in (plan, timed))
    assert ended - fixed == pytest.approx(4)


def test_joined_paths_take_longer_each_and_fewer_of_them(load: Load, dataset_data: dict[str, Any]) -> None:
    """50 pixels at 8 spp and 100 paths a second; a goal of 0.1 takes (1.5 / 0.1)^2 = 225 samples, with 0.4 times the
    noise 36."""
    rates = replace(RATES, noise=1.5, joined_time=1.25, joined_noise=0.4)

    def costs(**render: Any) -> list[Cost]:
        return [view_cost(plan_of(load, dataset_data, {"i_t": "object", "mask": "object"}, transport=transport,
                                  **render), 1, 1, 0.4, "float32", rates) for transport in ("camera", "joined")]

    camera, joined = costs()
    assert joined.paths == camera.paths and joined.seconds - camera.seconds == pytest.approx(0.25 * 50 * 8 / 100)
    camera, joined = costs(accuracy={"i_t": {"error": 0.1, "cap": 1000}})
    assert camera.paths - joined.paths == pytest.approx(50 * (225 - 36))
    assert camera.seconds - joined.seconds == pytest.approx(50 * (225 - 1.25 * 36) / 100)
    assert rates.of(plan_of(load, dataset_data, {"i_t": "object"}), "instance") == (1000, 1.5)


def test_measuring_the_bias_of_denoised_layers_costs_eighteen_renders(load: Load,
                                                                     dataset_data: dict[str, Any]) -> None:
    dataset_data["layers"] = {"i_s": "object", "i_t": "object", "d": "object", "mask": "object"}
    plain = Planner(load(dataset_data))
    assert calibration_cost(plain, RATES) == Cost()
    dataset_data["render"] = {"denoise": {"layers": ["i_t"], "examples": 3}}
    planner = Planner(load(dataset_data))
    plan = first_plan(planner)
    assert plan is not None
    only = plan.model_copy(update={"render": plan.render.model_copy(update={"layers": (("i_t", "object"),)})})
    window = window_share(planner.arrangement(planner.examples[plan.index].view.pair), Pinhole.of(plan.camera, 8, 8))
    one, found = view_cost(only, 1, 1, window, "float32", RATES), calibration_cost(planner, RATES)
    assert found.seconds == pytest.approx(3 * (2 + 16) * one.seconds) and found.bytes == 0
    assert found.paths == pytest.approx(54 * one.paths) and found.passes == 9 * 2
    difference = estimate(planner, views=1000, rates=RATES).total.seconds - estimate(
        plain, views=1000, rates=RATES).total.seconds
    assert difference == pytest.approx(found.seconds)


def test_half_floats_take_half_and_empty_pixels_next_to_nothing(load: Load, dataset_data: dict[str, Any]) -> None:
    plan = plan_of(load, dataset_data, {"mask": "object"})
    assert view_cost(plan, 1, 1, 0.4, "float16", replace(RATES, empty_share=0.1)).bytes == pytest.approx(
        1000 + 200 * 2 * (0.25 * 0.5 + 0.75 * 0.1))


def test_extrapolation_by_hand() -> None:
    costs = [Cost(passes=5, pixels=10), Cost(passes=5, pixels=14)]
    total, error = extrapolate(costs, 8)
    assert (total.passes, total.pixels) == (40, 96)
    assert (error.passes, error.pixels) == (0, pytest.approx(8 * (8 * (1 - 2 / 8) / 2) ** 0.5))
    assert extrapolate(costs, 2)[1].pixels == 0


def test_planning_every_view_leaves_no_error_and_is_the_sum(load: Load) -> None:
    planner = Planner(load())
    whole = estimate(planner, views=1000, rates=RATES)
    assert (whole.examples, whole.views, whole.tried, whole.planned) == (52, 14, 14, 14)
    assert astuple(whole.error) == (0, 0, 0, 0, 0)
    assert whole.total.passes == 12 * (1 + 2 + 4 + 1 + 4) + 2 * (1 + 1 + 2 + 1 + 2) == sum(whole.runs.values())
    assert whole.runs == {"source": 14, "source_clean": 0, "target": 26, "rough": 52, "first_hit": 14,
                          "first_hit_rough": 52, "instance": 0, "pbr": 0, "empty": 0}
    by_hand = sum(view_cost(planner.example(ref), 1, 1, 0.4, "float32", RATES).bytes for ref in planner.examples)
    assert whole.total.bytes == pytest.approx(by_hand)


def test_a_few_views_come_near_the_whole_and_say_how_near(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["splits"][0]["views"] = 6
    planner = Planner(load(dataset_data))
    whole, part = estimate(planner, views=1000), estimate(planner, views=12)
    assert part.planned < whole.planned and part.error.pixels > 0
    assert abs(part.total.pixels - whole.total.pixels) < 4 * part.error.pixels
    assert estimate(planner, views=12) == part


def failing(planner: Planner, monkeypatch: pytest.MonkeyPatch, split: str, cameras: tuple[int, ...]) -> None:
    """From now on no example of these cameras of a split can be planned."""
    plan = planner.example

    def example(ref: ExampleRef) -> ExamplePlan:
        if ref.view.pair.split == split and ref.view.camera in cameras:
            raise PlanError(f"expected light on {ref.view.name}")
        return plan(ref)

    monkeypatch.setattr(planner, "example", example)


def test_views_that_cannot_be_planned_are_passed_over_and_counted(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    planner = Planner(load())
    whole = estimate(planner, views=1000)
    failing(planner, monkeypatch, "train", (1,))
    part = estimate(planner, views=1000)
    assert (part.views, part.tried, part.planned) == (14, 14, 8)
    assert (part.runs, part.total.passes) == (whole.runs, whole.total.passes) and part.error.pixels > 0


def test_a_split_of_which_no_view_can_be_planned_is_refused(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    planner = Planner(load())
    failing(planner, monkeypatch, "eval", (0,))
    with pytest.raises(PlanError, match="expected light on eval/000000") as caught:
        estimate(planner, views=1000)
    assert len(caught.value.problems) == 2
