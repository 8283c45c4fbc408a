"""Camera paths against themselves: no gain, no bias, honest intervals; and the arithmetic of the benchmark."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.transports.bias import bias
from benchmarks.transports.interval_coverage import coverage, holds
from benchmarks.transports.lit_pass import LitPass, passes_of
from benchmarks.transports.race import Race, Side, race
from benchmarks.transports.runs import GROUPS, TRUTH_SPP, Regions, Runs, truth
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate

CAUSTICS = Path(__file__).parents[2] / "benchmarks" / "transports" / "caustics" / "caustics.yaml"
MINI = CAUSTICS.parents[3] / "scene_specs" / "3df-lighting-mini.yaml"
SMALL = ("image.width=16", "image.height=16", "render.max_depth=3")
PIXELS = 600


@pytest.fixture(scope="module")
def case() -> LitPass:
    activate("llvm")
    plugins.register()
    return next(passes_of(MINI, ["22t"], SMALL))


def runs_of(seed: int, number: int, mean: float, spread: float) -> Runs:
    """Runs of independent normal pixels about (1 + brightness) `mean`."""
    draws, bright = np.random.default_rng(seed), np.linspace(1, 2, PIXELS)[:, None]
    sixths = np.arange(PIXELS) * GROUPS // PIXELS
    inside = [np.ones(PIXELS, dtype=bool), np.arange(PIXELS) < 60, *(sixths == group for group in range(GROUPS))]
    runs = Runs(pixels=np.arange(PIXELS), inside=np.stack(inside, axis=1))
    for _ in range(number):
        runs.add(mean * bright + spread * draws.standard_normal((PIXELS, 3)))
    return runs


def side(variance: float, seconds: float, *errors: float) -> Side:
    return Side(variances=[variance, variance], seconds=seconds, errors=errors)


def test_a_pass_covers_what_its_plan_traces(case: LitPass) -> None:
    with case.opened() as opened:
        assert len(opened.pixels) == 256 and 0 < opened.object.sum() < 256
        regions = Regions.of(opened)
    assert regions.inside[:, 2:].sum(axis=1).tolist() == [1] * 256
    rough = next(passes_of(MINI, ["22r"], SMALL))
    with rough.opened() as opened:
        assert opened.object.all() and len(opened.pixels) < 256


def test_the_key_knows_what_is_rendered_and_not_how(case: LitPass) -> None:
    effects = case.plan.effects
    joined = tuple(entry.model_copy(update={"transport": "joined"}) for entry in effects.passes)
    other = case.plan.model_copy(update={"effects": effects.model_copy(update={"passes": joined})})
    assert replace(case, plan=other).planned == "joined"
    assert replace(case, plan=other).key() == case.key()
    longer = tuple(entry.model_copy(update={"max_depth": 9}) for entry in effects.passes)
    other = case.plan.model_copy(update={"effects": effects.model_copy(update={"passes": longer})})
    assert replace(case, plan=other).key() != case.key()


@pytest.mark.parametrize("name", ["t", "99t", "0x", "-1t", ""])
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="expected the index"):
        list(passes_of(CAUSTICS, [name]))


def test_camera_paths_gain_nothing_over_themselves(case: LitPass, tmp_path: Path) -> None:
    with case.opened() as opened:
        known = truth(case, 4, tmp_path, opened)
        found = race(case, opened, "camera", 16, 8, known.reference())
        shares = coverage(opened, ("camera",), 16, 8)
        again = truth(case, 6, tmp_path, opened)
        whole = truth(case, 6, tmp_path / "other", opened)
    assert 0.5 < found.v < 2
    assert np.mean(found.new.errors) == pytest.approx(np.mean(found.old.errors), rel=0.5)
    assert holds(shares)
    assert again.number == 6
    assert np.array_equal(again.means, whole.means) and np.array_equal(again.halves, whole.halves)


def test_the_cases_with_caustics_can_be_planned() -> None:
    found = list(passes_of(CAUSTICS, ["0t", "1t", "2t"]))
    assert [case.lamps for case in found] == ["area"] * 3
    assert ["glass" in case.plan.effects.features for case in found] == [False, True, False]


def test_ratios_by_hand() -> None:
    planned = SimpleNamespace(planned="joined")
    found = Race(case=planned, spp=4, old=side(0.4, 2.0, 0.5, 0.5, 2.0), new=side(0.1, 3.0, 0.25, 0.25, 0.25))
    assert (found.v, found.t, found.p) == pytest.approx((0.25, 1.5, 0.375))
    assert found.e == pytest.approx((0.375, 0.75))
    assert found.doubt == 0 and found.planned == found.p
    assert Race(case=SimpleNamespace(planned="camera"), spp=4, old=found.old, new=found.new).planned == 1
    assert Race(case=planned, spp=4, old=found.old, new=side(0.1, 3.0)).e is None


def test_the_error_of_a_reference() -> None:
    runs = runs_of(1, 16, 1.0, 0.1)
    mean = np.linspace(1, 2, PIXELS)
    of_one = np.mean(0.01 / (mean**2 + 0.01 * 1.5**2))
    assert runs.reference().own_error() == pytest.approx(of_one / 16, rel=0.15)
    dark = runs.reference(np.arange(PIXELS) < 60)
    assert dark.mean.shape == (60, 3) and dark.error(runs.mean()) == pytest.approx(1e-9, abs=1e-9)
    assert runs.grey()[1].mean() == pytest.approx(0.01 / 3 / 16, rel=0.1)
    assert runs.regions()[0][:2] == pytest.approx([1.5, mean[:60].mean()], rel=1e-2)


def test_a_bias_is_found_where_there_is_one() -> None:
    """2000 cases without any would have one |Z| of 3.5 among them; a shift of 0.2% is some 40 standard errors."""
    old = runs_of(1, 32, 1.0, 0.05)
    none, some = (bias("x", "sphere", old, runs_of(2, 32, mean, 0.05), 64) for mean in (1.0, 1.002))
    assert not none.wrong and abs(none.z[0]) < 3.5
    assert some.wrong and some.difference[0] == pytest.approx(0.2, abs=0.03) and some.z[0] > 10
    assert np.sqrt(np.mean(none.pixels**2)) == pytest.approx(np.sqrt(62 / 60), rel=0.1)
    assert none.noise[0] == pytest.approx(none.noise[1] * np.sqrt(TRUTH_SPP / 64), rel=0.5)
