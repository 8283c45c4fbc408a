"""How far denoised layers may be trusted: what is compared with what, and where the figures end up."""

import sys
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.builder import Event
from dataset_builder.engine import calibration, local
from dataset_builder.engine.calibration import as_asked, calibrate, candidates, compare, converged
from dataset_builder.engine.unit import BuildJob
from dataset_builder.errors import PlanError, UserError
from dataset_builder.label.example_plan import ExamplePlan, GoalPlan
from dataset_builder.planning.effects.decisions import FACTOR
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering import oidn
from dataset_builder.shards.card import card
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.reader import open_dataset
from dataset_builder.spec.load import load_dataset
from tests.plans import example_plan
from tests.small_specs import contents, run_build, write_spec

try:
    oidn.require()
    MISSING = ""
except UserError as error:
    MISSING = str(error)
needs_oidn = pytest.mark.skipif(bool(MISSING), reason=f"Open Image Denoise: {MISSING}")

TINY = """\
name: tiny
seed: 3
image: {width: 16, height: 16}
layers: {i_t: frame, s_prime: object, mask: object, mask_rough: object, depth: frame}
render: {spp: 4, max_depth: 3}
rough: {sigma: 0.004, edge_length: 0.3, rounds: 0}
camera: {azimuth: 20, elevation: 20, coverage: [0.1, 0.6]}
gates: {mask_overlap: 0.1}
splits:
  - name: train
    objects: {count: 1, from: [objects/cabinet.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
    views: 2
"""
"""Two examples."""

DENOISE = "render.denoise={layers: [i_t, s_prime], keep_raw: true, examples: 1}"
KEYS = {"layer", "bias", "bias_error", "pixel_bias", "relmse_raw", "relmse_denoised", "relmse_reference", "examples",
        "known"}


def denoising_plan() -> ExamplePlan:
    layers = (("i_t", "frame"), ("i_t_raw", "frame"), ("d", "object"), ("s_prime", "object"), ("mask", "object"))
    plan = example_plan(layers=layers)
    goals = (GoalPlan(layer="i_t", error=0.02, seconds=3.0, cap=64),)
    update = {"denoise": ("i_t", "s_prime"), "keep_raw": True, "goals": goals}
    return plan.model_copy(update={"render": plan.render.model_copy(update=update)})


# What is rendered


def test_examples_are_spread_over_the_dataset(small_spec: Path) -> None:
    planner = Planner(load_dataset(small_spec))
    assert [ref.index for ref in candidates(planner, 1)] == [4, 0, 8]
    assert [ref.index for ref in candidates(planner, 2)] == [0, 8, 4]
    assert [ref.index for ref in candidates(planner, 7)] == [0, 4, 8]


def test_noisy_renders_are_the_dataset_s_own_but_for_the_seed() -> None:
    plan = denoising_plan()
    first, second = (as_asked(plan, repeat) for repeat in (0, 1))
    assert first.render.layers == (
        ("i_t", "frame"), ("i_t_raw", "frame"), ("i_t_se", "frame"), ("s_prime", "object"), ("s_prime_raw", "object"),
        ("s_prime_se", "object"), ("mask", "object"))
    assert first.render.goals == plan.render.goals and first.render.spp_target == plan.render.spp_target
    assert first.render.denoise == plan.render.denoise and first.effects == plan.effects
    assert len({plan.render.seed, first.render.seed, second.render.seed, converged(plan).render.seed}) == 4


def test_references_are_raw_and_have_a_quarter_of_the_noise() -> None:
    plan, reference = denoising_plan(), converged(denoising_plan())
    assert reference.render.denoise == () and dict(reference.render.layers).keys() == {
        "i_t", "i_t_se", "s_prime", "s_prime_se", "mask"}
    assert {extent for _, extent in reference.render.layers} == {"object"}
    assert {entry.extent for entry in reference.effects.passes} == {"object"}
    assert reference.render.spp_target == FACTOR * plan.render.spp_target
    goal, = reference.render.goals
    assert (goal.error, goal.seconds, goal.cap) == (0.02 / 4, 3.0 * 16, 64 * 16)


def test_the_first_reason_is_told_where_no_example_can_be_measured(tmp_path: Path) -> None:
    """A closed room and a source outside of it: said of the first example that was tried, once."""
    overrides = ("source.open=[]", "render.denoise={layers: [i_t], examples: 2}")
    spec = write_spec(tmp_path, {"rooms/den.yaml": "width: 4\ndepth: 4\nheight: 2.5\nwindows: 0\n"})
    loaded = load_dataset(spec, overrides)
    job = BuildJob.of(loaded, tmp_path / "out", backend="llvm", threads=1)
    with pytest.raises(PlanError, match="the first reason:") as caught:
        calibrate(loaded, job, {}, run=local.run, workers=1)
    rule, *reasons = caught.value.problems
    assert rule.path == "render.denoise" and [reason.path for reason in reasons] == ["source"]
    assert reasons[0].where.startswith("train/") and "no windows" in reasons[0].rule


# What is measured


def images(value: np.ndarray, raw: np.ndarray, error: float, mask: np.ndarray) -> dict[str, np.ndarray]:
    return {"s": value, "s_raw": raw, "s_se": np.full_like(value, error), "mask": mask}


def test_figures_of_known_errors() -> None:
    """Means, bias and noise put in come out, to the error that is stated with them."""
    rng, shape, bias = np.random.default_rng(5), (96, 96, 3), 0.2
    mask = np.ones((96, 96, 1))
    mask[:, :8] = 0
    wrong = bias * np.where(np.arange(96)[:, None, None] < 48, 1.0, -0.5)
    reference = images(1.0 + rng.normal(0, 0.05, shape), np.zeros(shape), 0.05, mask)
    asked = [images(1.0 + wrong + rng.normal(0, 0.3, shape), 1.0 + rng.normal(0, 0.5, shape), 0.5, mask)
             for _ in range(2)]
    found = compare("s", asked, reference)
    scale = 1 / 1.01
    assert found.bias == pytest.approx(bias / 4, abs=4 * found.bias_error**0.5)
    assert found.bias_error**0.5 == pytest.approx(np.sqrt(0.5**2 / 2 + 0.05**2) / np.sqrt(88 * 96), rel=0.05)
    assert found.pixel_bias == pytest.approx(bias**2 * 0.625 * scale, rel=0.1)
    assert found.relmse_raw == pytest.approx((0.5**2 + 0.05**2) * scale, rel=0.1)
    assert found.relmse_denoised == pytest.approx((0.3**2 + 0.05**2 + bias**2 * 0.625) * scale, rel=0.1)
    assert found.relmse_reference == pytest.approx(0.05**2 * scale, rel=0.1)


def test_only_pixels_that_every_render_finds_count() -> None:
    """Few camera rays may miss the outline, and a layer of the object is black there."""
    whole, part = np.ones((4, 4, 1)), np.ones((4, 4, 1))
    part[0] = 0
    one, missing = np.ones((4, 4, 3)), np.ones((4, 4, 3)) * part
    figures = compare("s", [images(missing, missing, 0.0, part)] * 2, images(one, one, 0.0, whole))
    assert (figures.bias, figures.relmse_denoised, figures.pixel_bias) == (0, 0, 0)


# What becomes of the figures


def test_a_missing_denoiser_is_told_before_anything_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = write_spec(tmp_path, {"small.yaml": TINY})
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(UserError, match="pyoidn is not installed"):
        run_build(spec, tmp_path / "out", DENOISE)
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_spec(tmp_path_factory.mktemp("tiny"), {"small.yaml": TINY})


@pytest.fixture(scope="module")
def news(tiny: Path) -> list[Event]:
    """A denoised build beside the spec."""
    return run_build(tiny, tiny.parent / "denoised", DENOISE)


def manifest_of(events: list[Event]) -> Manifest:
    return next(event.manifest for event in events if event.manifest)


@needs_oidn
def test_every_record_and_the_manifest_hold_the_figures(tiny: Path, news: list[Event]) -> None:
    figures = manifest_of(news).denoised
    assert [item.layer for item in figures] == ["i_t", "s_prime"]
    assert next(event.denoised for event in news if event.denoised) == figures
    for item in figures:
        assert item.examples == 1 and 0 < item.relmse_reference < item.relmse_raw and abs(item.bias) < 0.3
    dataset = open_dataset(tiny.parent / "denoised")
    for index in range(2):
        record = dataset["train", index]["meta"]["record"]["denoised"]
        assert record == [item.model_dump() for item in figures] and set(record[0]) == KEYS
    text = card(manifest_of(news))
    assert "## Denoised layers" in text and f"{figures[0].relmse_denoised:.2e}" in text


@needs_oidn
def test_the_raw_twin_is_the_layer_that_an_undenoised_build_ships(tiny: Path, news: list[Event]) -> None:
    plain = run_build(tiny, tiny.parent / "plain")
    assert manifest_of(plain).denoised == () and "Denoised" not in card(manifest_of(plain))
    for index in range(2):
        smooth, raw = (open_dataset(tiny.parent / name)["train", index] for name in ("denoised", "plain"))
        assert raw["meta"]["record"]["denoised"] == []
        for name in ("i_t", "s_prime"):
            assert np.array_equal(smooth[f"{name}_raw"], raw[name])
            assert not np.array_equal(smooth[name], raw[name])
        assert np.array_equal(smooth["mask"], raw["mask"])


@needs_oidn
def test_two_workers_give_the_same_bytes(tiny: Path, news: list[Event]) -> None:
    run_build(tiny, tiny.parent / "two", DENOISE, workers=2)
    one, two = (contents(tiny.parent / name) for name in ("denoised", "two"))
    assert one.keys() == two.keys()
    assert [name for name in one if one[name] != two[name]] == []


@needs_oidn
def test_figures_are_measured_once(tiny: Path, news: list[Event], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(calibration, "measure", refuse)
    assert manifest_of(run_build(tiny, tiny.parent / "denoised", DENOISE)).denoised == manifest_of(news).denoised
    with pytest.raises(AssertionError, match="measured again"):
        run_build(tiny, tiny.parent / "denoised", DENOISE, "render.spp=8")
