"""What is decided to be simulated in each pass: lights, pixels and depths, and the figures behind it."""

from collections.abc import Callable
from typing import Any, get_args

import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.example_plan import Feature
from dataset_builder.planning.effects.decisions import PASSES
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import probe
from dataset_builder.spec.resolve import LoadedSpec
from tests.planning.effects.decided import GLASS, MATTE, Decide, choices, lamp, reason


@pytest.mark.parametrize("how", [{}, {"effects": "all"}, {"max_depth": 7}, {"fog": 0.1}])
def test_every_decision_has_a_reason_and_every_pass_an_entry(decide: Decide, how: dict[str, Any]) -> None:
    effects = decide(GLASS, (MATTE,), **how)
    assert all(decision.effect and decision.choice and decision.reason for decision in effects.decisions)
    assert tuple(entry.name for entry in effects.passes) == PASSES
    assert set(get_args(Feature)) <= {decision.effect for decision in effects.decisions}


def test_fog_that_no_planned_path_gets_through_is_refused(decide: Decide) -> None:
    with pytest.raises(PlanError, match=r"paths of at most 512 edges.*got an extinction of 30 per metre"):
        decide(fog=30.0, albedo=1.0)
    assert decide(fog=30.0, albedo=1.0, max_depth=20).of("target").max_depth == 20


def test_the_dome_is_dropped_where_it_finds_no_way_in(decide: Decide) -> None:
    lights = (lamp("dome"), lamp("area"), lamp("point", 0.0))
    closed = decide(lights=lights)
    assert closed.of("target").lights == closed.of("rough").lights == (1,)
    assert closed.of("source").lights == (0,)
    assert "cannot enter a room" in reason(closed, "lights of target")
    assert decide(lights=lights, room={"windows": 1}).of("target").lights == (0, 1)
    assert decide(lights=lights, room={"ceiling": False}).of("target").lights == (0, 1)


@pytest.mark.parametrize("how", [{}, {"effects": "all"}])
def test_a_pass_that_runs_in_the_dark_is_refused(decide: Decide, how: dict[str, Any]) -> None:
    with pytest.raises(PlanError, match=r"source: expected a light .* in the pass source, got none: dome left out: "
                       r"cannot enter a room with a ceiling and no windows \(remove parts of the room"):
        decide(opened=(), **how)
    with pytest.raises(PlanError) as caught:
        decide(opened=(), lights=(lamp("dome"), lamp("area", 0.0)), **how)
    assert [problem.path for problem in caught.value.problems] == ["source", "target", "target"]
    assert decide(opened=(), layers=(("i_t", "object"), ("mask", "object")), **how).of("target").lights == (0,)
    assert decide(opened=(), room={"windows": 1}, **how).of("source").lights == (0,)


def test_a_source_that_finds_no_way_in_is_told_before_anything_is_rendered(load: Callable[..., LoadedSpec],
                                                                         dataset_data: dict[str, Any]) -> None:
    dataset_data["source"] = {"open": []}
    with pytest.raises(PlanError, match=r"train/000000.*source: expected a light"):
        probe(Planner(load(dataset_data, room={"width": 6, "depth": 5, "height": 2.8, "windows": 0})))


def test_passes_that_no_layer_needs_do_not_run(decide: Decide) -> None:
    effects = decide(layers=(("i_t", "object"), ("mask", "frame")))
    assert choices(effects, "pass source") == choices(effects, "pass rough") == ["not run"]
    assert "none of its layers is requested" in reason(effects, "pass source")
    assert choices(effects, "pass target") == ["object"]
    assert choices(effects, "path depth of source") == choices(effects, "transport of source") == []
    assert choices(decide(layers=(("s_prime", "object"),)), "pass first_hit_rough") == ["object"]


def test_pixels_are_those_that_a_layer_asks_for(decide: Decide) -> None:
    effects = decide()
    assert [effects.of(name).extent for name in PASSES] == ["object", "frame", *["object"] * 6]
    assert reason(effects, "pass source").endswith("i_s")
    assert choices(effects, "light-free layers") == ["3 of 6"]


def test_depth_counts_only_what_stands_in_a_pass(decide: Decide) -> None:
    """Without walls and ceiling most light leaves at once."""
    dark = {"base_color.0": 0.1, "base_color.1": 0.1, "base_color.2": 0.1, "specular": 0.0}
    bright = {f"base_color.{k}": 0.9 for k in range(3)} | {"specular": 0.0}
    effects, asked = decide(dark, (dark,), bias=0.01), decide(dark, (bright,), bias=0.01)
    assert asked.of("target").max_depth > effects.of("source").max_depth
    assert "99.9% bound" in reason(asked, "path depth of target")
    assert len({entry.max_depth for entry in asked.passes if entry.name in ("target", "rough", "empty", "pbr")}) == 1
    assert [decide(max_depth=9).of(name).max_depth for name in PASSES] == [1, 9, 9, 9, 1, 9, 9, 9]


def test_all_simulates_everything_everywhere(decide: Decide) -> None:
    effects = decide(effects="all", lights=(lamp("dome"), lamp("area"), lamp("point", 0.0)), max_depth=4)
    assert effects.features == get_args(Feature)
    assert {entry.extent for entry in effects.passes} == {"frame"}
    assert {entry.max_depth for entry in effects.passes} == {128}
    assert {entry.max_depth for entry in decide(effects="all", max_depth=200).passes} == {200}
    assert effects.of("rough").lights == (0, 1, 2) and effects.of("source").lights == (0,)
    everything = "everything simulated, as requested"
    assert {decision.reason for decision in effects.decisions} == {
        everything, f"{everything}; light paths know no fog"}
    assert {entry.transport for entry in effects.passes} == {"camera"}


def test_what_belongs_to_the_view_does_not_follow_the_target_light(decide: Decide) -> None:
    one, other = decide(GLASS, lights=(lamp("point"),)), decide(GLASS, lights=(lamp("area"), lamp("dome")))
    assert one.features == other.features
    for name in ("first_hit", "source", "first_hit_rough"):
        assert one.of(name) == other.of(name)
