"""How rough twins are planned: every number drawn from a path of its own, edges fine enough, flat things noticed."""

from collections.abc import Callable
from typing import Any

import pytest

from dataset_builder.geometry.rough_base import bounding_radius
from dataset_builder.label.example_plan import ExamplePlan, RoughPlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.rough import RoughSpec
from dataset_builder.spec.rough_levels import NAMED, sigma_of

Load = Callable[..., LoadedSpec]
FIELD = {"kind": "field", "sigma": {"uniform": [0.001, 0.01]}, "length": 0.1, "octaves": 2}


def planned(load: Load, data: dict[str, Any], rough: dict[str, Any], index: int = 0) -> RoughPlan:
    return example(load, data, rough, index).rough


def example(load: Load, data: dict[str, Any], rough: dict[str, Any], index: int = 0) -> ExamplePlan:
    return plan_example(load({**data, "rough": rough}), index)


def radius_of(load: Load, data: dict[str, Any]) -> float:
    loaded = load(data)
    return bounding_radius(asset_of(plan_example(loaded, 0).target.object, loaded.path.parent).mesh)


def test_plain_noise_has_no_steps(load: Load, dataset_data: dict[str, Any]) -> None:
    plan = planned(load, dataset_data, {"sigma": 0.004})
    assert (plan.steps, plan.sigma, plan.edge_length, plan.rounds, plan.coarsen) == ((), 0.004, 0.04, 1, True)
    assert not planned(load, dataset_data, {"coarsen": False}).coarsen


def test_numbers_of_steps_are_drawn_and_move_no_other(load: Load, dataset_data: dict[str, Any]) -> None:
    one = planned(load, dataset_data, {"steps": [FIELD]})
    two = planned(load, dataset_data, {"steps": [FIELD, {"kind": "white", "sigma": {"uniform": [0, 0.01]}}, FIELD]})
    assert one.steps[0] == two.steps[0] != two.steps[2]
    sigmas = [step["sigma"] for step in two.steps]
    assert 0.001 <= sigmas[0] <= 0.01 and len(set(sigmas)) == 3
    assert two.sigma == pytest.approx(sum(sigma**2 for sigma in sigmas) ** 0.5)
    assert two.coarsen and not one.coarsen
    other_light, other_view = (planned(load, dataset_data, {"steps": [FIELD]}, index) for index in (1, 2))
    assert other_light == one and other_view.steps[0]["sigma"] != one.steps[0]["sigma"]


def test_edges_follow_the_shortest_length(load: Load, dataset_data: dict[str, Any]) -> None:
    radius = radius_of(load, dataset_data)
    assert planned(load, dataset_data, {"steps": [FIELD], "edge_length": 9}).edge_length == pytest.approx(0.05 * radius)
    assert planned(load, dataset_data, {"steps": [FIELD], "edge_length": 1e-3}).edge_length == 1e-3
    asked = example(load, dataset_data, {"steps": [FIELD], "edge": 0.2})
    assert asked.rough.edge_length == pytest.approx(0.2 * radius)
    assert any("too long for all of field" in note for note in asked.notes)
    fine = example(load, dataset_data, {"steps": [FIELD], "edge": 0.05})
    assert not any("rough mesh" in note for note in fine.notes)
    narrow = [{"kind": "bumps", "width": 0.02}, {"kind": "scanlines", "length": 0.03}]
    assert planned(load, dataset_data, {"steps": narrow, "edge_length": 9}).edge_length == pytest.approx(0.02 * radius)
    assert planned(load, dataset_data, {"steps": [{"kind": "smooth"}]}).edge_length == 0.04


def test_named_levels_are_examples_of_their_own(load: Load, dataset_data: dict[str, Any]) -> None:
    rough = {"level": ["smooth", "extreme"]}
    smooth, extreme = (planned(load, dataset_data, rough, index) for index in (0, 1))
    assert (smooth.name, smooth.sigma, smooth.steps[0]["sigma"]) == ("smooth", 0, 0)
    assert smooth.edge_length == extreme.edge_length
    assert (extreme.name, extreme.level, extreme.sigma) == ("extreme", 1, 0.024)
    assert [sigma_of(name) for name in NAMED] == [0, 0.003, 0.006, 0.012, 0.024]


def test_like_is_planned_as_the_fields_that_it_stands_for(load: Load, dataset_data: dict[str, Any]) -> None:
    plan = planned(load, dataset_data, {"steps": [{"kind": "like", "of": "field"}, {"kind": "smooth"}]})
    assert [step.kind for step in plan.steps] == ["field", "field", "smooth"]
    assert all(step.along == "normal" for step in plan.steps[:2])


def test_flat_things_are_said_to_stay_above_their_support(load: Load, dataset_data: dict[str, Any]) -> None:
    """Boxes are flat where noise of three deviations reaches their top."""
    for sigma, flat in ((0.004, False), (0.8, True)):
        plan = example(load, dataset_data, {"sigma": sigma})
        assert plan.rough.above_support == flat == any("mirrored up" in note for note in plan.notes)
    assert planned(load, dataset_data, {"steps": [{"kind": "bumps", "height": 3}]}).above_support


@pytest.mark.parametrize(("rough", "rule"), [
    ({"sigma": 0.1, "level": "light"}, "expected one of sigma, level and steps, got sigma and level"),
    ({"steps": [], "level": "light"}, "expected one of sigma, level and steps, got level and steps"),
    ({"sigma": None}, "expected one of sigma, level and steps, got none"),
    ({"steps": [{"kind": "wite"}]}, "expected a mapping whose kind is one of white, field"),
    ({"steps": [{"kind": "field", "length": 0}]}, r"expected in \[0.0001, 100\], got 0"),
    ({"steps": [{"kind": "white", "sigma": -1}]}, "expected >= 0, got -1"),
    ({"level": "lite"}, "'smooth', 'light'"),
])
def test_wrong_specs_are_named(rough: dict[str, Any], rule: str) -> None:
    with pytest.raises(ValueError, match=rule):
        RoughSpec.model_validate(rough)
