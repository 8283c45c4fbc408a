"""The scene without its object and with its rough mesh: random numbers shared with the target pass, means that others
have too, and pixels that the object changes nothing of."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from dataset_builder.errors import SpecError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import ALIKE
from dataset_builder.planning.plan import plan_example
from dataset_builder.rendering.examples import Rendered, render_view
from dataset_builder.rendering.pass_inputs import compared_with, in_step, needed_passes
from dataset_builder.spec.load import load_dataset

Plan = Callable[..., ExamplePlan]
PAIR = "layers={mask: object, i_t: frame, i_t_empty: frame, i_t_se: frame, i_t_empty_se: frame}"
CHANCE = 1e-3
"""Of a right renderer to fail one Z-test, as far as errors are Gaussian; seeds are fixed, so it is drawn once."""
LIMIT = float(norm.isf(CHANCE / 2))


@pytest.fixture
def plan(small_spec: Path) -> Plan:
    """Plans example `index` of the small dataset, overridden."""
    return lambda *overrides, index=0: plan_example(load_dataset(small_spec, overrides), index)


def rendered(plan: ExamplePlan, seed: int | None = None) -> Rendered:
    """The one example of a plan, perhaps with another seed."""
    if seed is not None:
        plan = plan.model_copy(update={"render": plan.render.model_copy(update={"seed": str(seed)})})
    example, = render_view([plan], Path())
    return example


def away(plan: ExamplePlan) -> ExamplePlan:
    """The same view with the object below the floor of the closed room, where no light gets and nobody sees it."""
    x, y, _ = plan.target.position
    return plan.model_copy(update={"target": plan.target.model_copy(update={"position": (x, y, -1.5)})})


def z_of(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> float:
    """Of the difference of two means over pixels of independent pictures, from their standard errors; the channels of a
    pixel depend on each other, so that one alone counts."""
    (a, ea), (b, eb) = ((values[..., 1], errors[..., 1]) for values, errors in (one, other))
    return float((a - b).sum() / np.sqrt((ea**2 + eb**2).sum()))


@pytest.mark.parametrize("transport", ["camera", "joined"])
def test_an_object_that_no_path_meets_changes_no_bit(plan: Plan, transport: str) -> None:
    hidden = away(plan(PAIR, f"render.transport={transport}"))
    assert {hidden.effects.of(name).transport for name in ALIKE} == {transport}
    layers = rendered(hidden).layers
    assert layers["i_t"].max() > 0 and not layers["mask"].any()
    assert np.array_equal(layers["i_t"], layers["i_t_empty"]) and np.array_equal(layers["i_t_se"],
                                                                                layers["i_t_empty_se"])


@pytest.mark.parametrize(("transport", "most"), [("camera", 0.1), ("joined", 0.2)])
def test_what_the_object_changes_is_smoother_than_of_two_renders(plan: Plan, transport: str, most: float) -> None:
    """Variance over seeds of i_t - i_t_empty beside the object, over the sum of both variances: 1 if independent."""
    whole = plan(PAIR, f"render.transport={transport}", "render.spp=[8, 8]")
    found = [rendered(whole, seed).layers for seed in range(4)]
    beside = found[0]["mask"][..., 0] == 0
    full, empty = (np.array([layers[name][beside] for layers in found], dtype=np.float64) for name in (
        "i_t", "i_t_empty"))
    apart = full.var(axis=0, ddof=1).mean() + empty.var(axis=0, ddof=1).mean()
    assert (full - empty).var(axis=0, ddof=1).mean() < most * apart
    assert np.abs((full - empty).mean(axis=0)).max() > 0


def test_the_scene_without_the_object_is_that_with_it_put_away(plan: Plan) -> None:
    """Another scene, other random numbers and the other transport; as pictures and as noise they agree."""
    empty = rendered(plan(PAIR, "render.transport=camera", "render.spp=64")).layers
    put_away = rendered(away(plan(PAIR, "render.transport=joined", "render.spp=64")), seed=77).layers
    assert empty["i_t_empty"].min() >= 0
    assert abs(z_of((empty["i_t_empty"], empty["i_t_empty_se"]), (put_away["i_t"], put_away["i_t_se"]))) < LIMIT
    inside = empty["mask"][..., 0] == 1
    assert abs(z_of(*(tuple(layers[name + end][inside] for end in ("", "_se")) for layers, name in (
        (empty, "i_t_empty"), (put_away, "i_t"))))) < LIMIT
    assert np.abs(empty["i_t"] - empty["i_t_empty"])[inside].mean() > 10 * np.abs(
        empty["i_t_se"][inside]).mean() / np.sqrt(inside.sum())


def test_joined_paths_in_step_find_what_camera_paths_find(plan: Plan) -> None:
    """Dark candidates and numbers by lane change no mean; a repetition has the same bits."""
    joined, camera = (plan(PAIR, f"render.transport={one}", "render.spp=64") for one in ("joined", "camera"))
    assert compared_with(joined, "target") == "empty" and not in_step(camera, "target")
    ours, theirs = rendered(joined).layers, rendered(camera, seed=9).layers
    for name in ("i_t", "i_t_empty"):
        assert abs(z_of(*((layers[name], layers[f"{name}_se"]) for layers in (ours, theirs)))) < LIMIT, name
    again = rendered(joined).layers
    assert all(np.array_equal(ours[name], again[name]) for name in ours)


def test_the_rough_mesh_in_the_frame_is_the_clean_one_where_it_is_not_rough(plan: Plan) -> None:
    """Sigma 0 leaves a mesh of the same surface, cut finer: the same paths but where rounding sends one elsewhere."""
    layers = rendered(plan("layers={i_t: frame, i_pbr: frame, mask: object, i_t_se: frame, i_pbr_se: frame}",
                           "render.transport=camera")).layers
    close = np.isclose(layers["i_t"], layers["i_pbr"], rtol=1e-3, atol=1e-4).all(axis=-1)
    assert close.mean() > 0.9
    other = rendered(plan("layers={i_pbr: frame, i_pbr_se: frame}", "render.transport=camera"), seed=5).layers
    assert abs(z_of((layers["i_t"], layers["i_t_se"]), (other["i_pbr"], other["i_pbr_se"]))) < LIMIT


def test_the_rough_pass_keeps_its_bits_whatever_shows_the_frame(plan: Plan) -> None:
    alone = rendered(plan("layers={s_prime: object, mask_rough: object}", index=1))
    beside = rendered(plan("layers={s_prime: object, mask_rough: object, i_pbr: frame}", index=1))
    for name, values in alone.layers.items():
        assert np.array_equal(values, beside.layers[name]), name
    assert beside.layers["i_pbr"].min() >= 0 and set(beside.seconds) == set(alone.seconds) | {"pbr"}


def test_only_what_is_asked_for_runs_and_on_the_target_pass_pixels(plan: Plan) -> None:
    alone = plan("layers={i_t_empty: frame}")
    assert needed_passes(alone) == ("first_hit", "empty")
    record = {entry.name: entry for entry in rendered(alone).record.passes}
    assert record["empty"].paths == 24 * 20 * 16 and not record["target"].paths
    assert rendered(alone).record.lighting_sh[0][0] > 0
    assert needed_passes(plan("layers={i_pbr: frame}")) == ("first_hit", "first_hit_rough", "pbr")
    wide = plan("layers={i_t: frame, i_t_empty: object}")
    assert wide.effects.of("empty").extent == "frame"
    assert "as the pass target" in next(each.reason for each in wide.effects.decisions if each.effect == "pass empty")
    narrow = plan("layers={i_t: object, i_t_empty: frame}")
    assert (narrow.effects.of("target").extent, narrow.effects.of("empty").extent) == ("object", "frame")
    cut = rendered(wide).layers["i_t_empty"]
    assert 0 < np.count_nonzero(cut.any(axis=-1)) < 24 * 20


def test_a_goal_is_refused_where_random_numbers_are_shared(small_spec: Path) -> None:
    rule = r"accuracy.i_t: expected a fixed spp, since i_t shares its random numbers with i_t_empty, got a goal \(set r"
    with pytest.raises(SpecError, match=rule):
        load_dataset(small_spec, [PAIR, "render.accuracy={i_t: {error: 0.1}}"])
    load_dataset(small_spec, ["layers={i_t_empty: frame}", "render.accuracy={i_t_empty: {error: 0.1}}"])
