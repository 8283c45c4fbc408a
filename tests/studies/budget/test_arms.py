"""Mixes, and ways to spend a budget: worked out by hand, and the examples that are taken first."""

from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any, get_args

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.lightnet.settings import ObjectiveSpec, load_training
from dataset_builder.planning.catalogue import examples, pairs_of
from dataset_builder.planning.effects import light_left
from dataset_builder.rendering import oidn
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.studies.budget.arms import LOSSES, Mix, arms_of, even, mixes_of
from dataset_builder.studies.budget.budget_study import (
    SIZES,
    BudgetStudy,
    first_examples,
    require,
    spread_out,
)
from dataset_builder.studies.budget.render_costs import CostRow, RenderCost, _planning, cores_had
from dataset_builder.studies.sampled import StudySpec
from dataset_builder.studies.trainings import base_of, changed
from tests.small_specs import write_spec

MANY = ("splits.train.objects.count=4", "splits.train.scenes.count=3")


def study(spec: Path, *overrides: str) -> BudgetStudy:
    training = base_of(load_training(None, ["data.held_out=test"]))
    return BudgetStudy(spec=spec, overrides=overrides, size=SIZES["small"], training=training, out=Path("nowhere"))


def test_mixes_are_every_spp_raw_and_denoised_and_each_pass_raised_once() -> None:
    found = mixes_of((4, 16, 64), 16, denoise=True)
    assert [mix.name for mix in found] == ["4", "16", "64", "4-denoised", "16-denoised", "64-denoised",
                                           "16-target-64", "16-rough-64", "16-source-64"]
    assert [mix.title for mix in found[3:7]] == ["4 spp denoised", "16 spp denoised", "64 spp denoised",
                                                 "16 spp (I_t 64) raw"]
    assert [mix.name for mix in mixes_of((4, 16), 4, denoise=False)] == ["4", "16", "4-target-16", "4-rough-16",
                                                                         "4-source-16"]


def test_every_arm_of_a_budget_costs_the_same() -> None:
    raised = Mix(target=16, rough=4, source=4)
    costs = {even(4): 0.5, even(16): 1.0, even(16, denoised=True): 1.5, raised: 0.8}
    found = {arm.name: arm for arm in arms_of(costs, (1, 3), 6)}
    # 6 examples at 16 spp are 6 s, three times as much is 18 s
    assert {name: arm.examples for name, arm in found.items()} == {
        "4-x1": 12, "16-x1": 6, "16-denoised-x1": 4, "4-x3": 36, "16-x3": 18, "16-denoised-x3": 12,
        "4-target-16-x3": 22}
    assert {arm.seconds for arm in found.values()} == {6.0, 18.0}
    for arm in found.values():
        assert arm.examples * costs[arm.mix] <= arm.seconds < (arm.examples + 1) * costs[arm.mix]


def test_losses_that_expect_noise_are_tried_on_the_examples_of_plain_ones() -> None:
    costs = {even(4): 0.5, even(16): 1.0, even(16, denoised=True): 1.5}
    found = {arm.name: arm for arm in arms_of(costs, (1, 3), 6, (even(4),))}
    assert set(found) - {arm.name for arm in arms_of(costs, (1, 3), 6)} == {"4-weighted-x3", "4-two_samples-x3"}
    for name in ("4-weighted-x3", "4-two_samples-x3"):
        assert replace(found[name], noise="plain") == found["4-x3"] and not found[name].even
    assert found["4-two_samples-x3"].title == "4 spp raw, loss of two samples, 36 examples"


def test_all_that_losses_can_make_of_noise_is_tried() -> None:
    assert tuple(LOSSES) == get_args(ObjectiveSpec.model_fields["noise"].annotation)


def test_losses_that_expect_noise_find_what_they_need(small_spec: Path) -> None:
    """At low and middle spp; mixes share their passes only if they ask for the same layers."""
    made = study(small_spec)
    assert made.noisy == (even(4), even(16))
    assert replace(made, size=replace(made.size, grid=(4, 16))).noisy == (even(4),)
    for mix in made.mixes:
        there = load_dataset(small_spec, made.train_settings(mix, 4)).dataset
        assert there.storage.standard_errors and ("i_t_half" in there.layers) is not mix.denoised


def test_a_budget_of_one_example_is_refused() -> None:
    with pytest.raises(UserError, match=r"at least two examples, got 2 s, which buy 1 of 16 spp denoised: .* --least"):
        arms_of({even(16): 1.0, even(16, denoised=True): 1.5}, (1,), 2)


def views(dataset: DatasetSpec, count: int) -> list[tuple[object, int, int, int]]:
    refs = {ref.key: ref for ref in examples(dataset)}
    found = [refs[key] for key in first_examples(dataset, count)]
    return [(ref.view.pair, ref.view.camera, ref.light, ref.level) for ref in found]


def test_the_first_examples_are_the_same_however_many_there_are(small_spec: Path) -> None:
    """Also across datasets of different sizes, so that arms share all that they can; pairs come before views."""
    made = study(small_spec, *MANY)
    few, many = (load_dataset(made.spec, made.train_settings(even(16), count)).dataset for count in (40, 150))
    assert [split.name for split in few.splits] == ["train"]
    # Two lights and two levels of noise: 4 variants of 12 pairs
    assert spread_out(made.dataset, made.dataset.split_of("train"), 40) == (1, 10)
    assert spread_out(made.dataset, made.dataset.split_of("train"), 150) == (4, 10)
    assert views(few, 10) == views(many, 10)
    first = views(many, 10)
    assert len({pair for pair, *_ in first}) == 10 == len(pairs_of(many.splits[0]))
    assert {(camera, light, level) for _, camera, light, level in first} == {(0, 0, 0)}


def test_mixes_change_samples_and_denoising_alone(small_spec: Path) -> None:
    made = study(small_spec)
    plain = load_dataset(small_spec, made.train_settings(even(16), 4)).dataset
    mix = Mix(target=64, rough=16, source=16, denoised=True)
    other = load_dataset(small_spec, made.train_settings(mix, 4)).dataset
    assert (other.render.spp.target, other.render.spp.rough, other.render.spp.first_hit) == (64, 16, 16)
    assert other.render.denoise.layers == ("i_t", "s_prime", "i_s") and not plain.render.denoise.layers
    same = {"spp": plain.render.spp, "denoise": plain.render.denoise}
    # A denoised I_t has no halves
    layers = {**other.layers, "i_t_half": other.layers["i_t"]}
    assert other.model_copy(update={"render": other.render.model_copy(update=same), "layers": layers}) == plain
    assert (plain.image.width, plain.image.height) == (64, 64), "the small study's size"
    held_out = load_dataset(small_spec, made.held_out_settings()).dataset
    assert [split.name for split in held_out.splits] == ["test"] and held_out.render.spp.first_hit == 512


@pytest.mark.parametrize(("overrides", "rule"), [
    (("layers={i_s: object, mask: object}",), "has no d, r, i_t, s_prime"),
    (("splits.test.name=other",), "expected a split test, got train, other"),
    (("render.batches=8", "render.spp=16"), "expected a divisor of 4, the spp of the study, got 8"),
    (("render.batches=3", "render.spp=12"), "expected an even number, for samples in two halves, got 3"),
])
def test_what_cannot_be_studied_is_refused_before_anything_is_rendered(small_spec: Path, overrides: tuple[str, ...],
                                                                       rule: str) -> None:
    with pytest.raises(UserError, match=rule):
        require(study(small_spec, *overrides))


def test_the_study_chooses_losses_itself(small_spec: Path) -> None:
    made = study(small_spec)
    with pytest.raises(UserError, match=r"objective\.noise: expected plain, which the study compares .* got weighted"):
        require(replace(made, training=changed(made.training, objective={"noise": "weighted"})))


def test_denoised_arms_need_the_denoiser(small_spec: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> str:
        raise UserError("render.denoise: expected pyoidn")
    monkeypatch.setattr(oidn, "require", none)
    with pytest.raises(UserError, match="pyoidn"):
        require(study(small_spec))
    require(replace(study(small_spec), denoise=False))


@pytest.mark.parametrize("grid", [(16,), (16, 4), (4, 4), (0, 4)])
def test_spp_to_compare_rise(small_spec: Path, grid: tuple[int, ...]) -> None:
    made = study(small_spec)
    with pytest.raises(UserError, match=r"--spp: expected at least two numbers >= 1, each larger than the one before"):
        require(replace(made, size=replace(made.size, grid=grid)))
    assert (made.size.base, replace(made.size, grid=(4, 16)).base) == (16, 4)


def test_pictures_have_the_size_that_the_user_asks_for(small_spec: Path) -> None:
    assert study(small_spec, "image={width: 40, height: 30}").dataset.image.width == 40


def test_costs_are_means_over_examples() -> None:
    cost = RenderCost.of([1.0, 3.0])
    assert (cost.seconds, cost.error, cost.examples) == (2.0, 1.0, 2) and RenderCost.of([1.0]).error == 0
    rows = [CostRow(example="a", mix="4", seconds=1.0, wall_seconds=4.0)] * 2
    assert cores_had(rows) == 0.25


def test_planning_counts_the_paths_that_a_view_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are kept for the view, so that planning it a second time would cost next to nothing."""
    spec, arrivals, ended = StudySpec(path=write_spec(tmp_path)), light_left.arrivals, list[float]()

    def traced(*args: Any) -> np.ndarray:
        found = arrivals(*args)
        ended.append(process_time())
        return found

    monkeypatch.setattr(light_left, "arrivals", traced)
    ref = spec.sample(1)[0]
    spec.planner().example(ref)
    first = len(ended)
    assert _planning(spec, ref) > 0 and len(ended) == 2 * first > 0
