"""Which arm is best and what it is told apart from: by hand, and by how often intervals hold what is true."""

import csv
from collections.abc import Sequence
from math import isnan, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from dataset_builder.lightnet.measures.metrics import Metrics
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.lightnet.settings import load_training
from dataset_builder.report.budget_page import sentences, write_page
from dataset_builder.studies.budget.arms import Arm, Mix, even, mixes_of
from dataset_builder.studies.budget.budget_results import ArmResult, BudgetResults, write_arms
from dataset_builder.studies.budget.budget_study import SIZES, BudgetStudy
from dataset_builder.studies.budget.render_costs import CostRow
from dataset_builder.studies.trainings import base_of


def scored(psnr: Sequence[float]) -> tuple[ScoreRow, ...]:
    """Two examples of each object."""
    return tuple(ScoreRow(method="", key=str(n), view="", object=f"object {n // 2}", room="", level=0, sigma=0.0,
                          seconds=0.0, metrics=Metrics(l1=0.1, psnr=value, ssim=0.5, lab=0.1))
                 for n, value in enumerate(psnr))


def result(mix: Mix, by_seed: Sequence[Sequence[float]], budget: float = 1.0, noise: str = "plain") -> ArmResult:
    arm = Arm(mix=mix, budget=budget, seconds=3600 * budget, examples=10, noise=noise)
    return ArmResult(arm=arm, learnt=9, scores=tuple(map(scored, by_seed)))


def test_the_spread_over_seeds_is_that_of_all_arms() -> None:
    """Means 20, 24 and 26, 28: after the rows' and columns' own, 1/2 is left of each with alternating signs."""
    found = BudgetResults((result(even(4), ([20.0] * 4, [24.0] * 4)), result(even(16), ([26.0] * 4, [28.0] * 4))))
    assert found.seed_deviation == pytest.approx(1.0)
    less = found.less(found.arms[1], found.arms[0])
    assert less.mean == 5.0 and less.error == pytest.approx(1.0)
    assert less.half_width == pytest.approx(t.ppf(0.975, 1))
    assert not less.told_apart and found.as_good(1.0) == [found.arms[1], found.arms[0]]


def test_with_one_seed_objects_alone_count() -> None:
    found = BudgetResults((result(even(4), ([20.0, 20.0, 21.0, 21.0],)), result(even(16), ([25.0, 25.0, 28.0, 28.0],))))
    assert isnan(found.seed_deviation)
    # Differences 5 and 7 of two objects: 6 with standard error 1
    less = found.less(found.arms[1], found.arms[0])
    assert (less.mean, less.error) == (6.0, pytest.approx(1.0)) and less.half_width == pytest.approx(t.ppf(0.975, 1))


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Made arms whose true difference is known: other objects, seeds that move all arms, seeds that move one."""
    rng, held, tries = np.random.default_rng(3), 0, 300
    for _ in range(tries):
        objects = rng.normal(0, 0.3, (4, 8)).repeat(2, axis=1)
        common, own = rng.normal(0, 1.0, 2), rng.normal(0, 0.2, (4, 2))
        values = 20 + np.arange(4.0)[:, None, None] + objects[:, None] + common[None, :, None] + own[:, :, None]
        arms = [result(even(spp), [list(map(float, rows)) for rows in arm])
                for spp, arm in zip((4, 16, 64, 256), values, strict=True)]
        less = BudgetResults(tuple(arms)).less(arms[3], arms[0])
        held += abs(less.mean - 3) <= less.half_width
    assert 0.93 - 2 * sqrt(0.93 * 0.07 / tries) <= held / tries


def test_the_best_of_each_budget_is_named_with_what_it_is_not_told_apart_from(tmp_path: Path) -> None:
    study = BudgetStudy(spec=Path("scene_specs/3df-lighting-mini.yaml"), overrides=(), size=SIZES["small"],
                        training=base_of(load_training()), out=tmp_path, device="cpu")
    gains = {"4": 0.0, "16": 2.0, "64": 1.99, "256": -2.0, "16-target-64": 3.0}
    shift = [0.0, 0.02, -0.01, -0.03, 0.01, 0.01]
    arms = [result(mix, [[20 + budget + gains.get(mix.name, 1.0) + sign * 0.01 + (number % 5 - 2) * one
                          for one in shift] for sign in (-1, 1)], budget)
            for budget in (1.0, 3.0) for number, mix in enumerate(mixes_of((4, 16, 64, 256), 16, denoise=True))
            if not mix.raised or budget == 3.0]
    plain = next(one for one in arms if one.arm.name == "4-x3")
    arms += [result(even(4), [[value + 0.5 for value in seed] for seed in plain.by_seed("psnr")], 3.0, noise)
             for noise in ("weighted", "two_samples")]
    found = BudgetResults(tuple(arms))
    assert [found.best(budget).arm.mix.name for budget in found.budgets] == ["16", "16-target-64"]
    first, second = sentences(found)
    assert "best is 16 spp raw, 10 examples, 23.00 dB" in first
    assert "not told apart from it: 64 spp raw; worse: 4 spp raw, 256 spp raw, 4 spp denoised" in first
    assert "not told apart from it: none; worse: 4 spp raw" in second and "4 spp raw, loss of two samples" in second
    assert found.plain(arms[-1]) is plain and found.less(arms[-1], plain).mean == pytest.approx(0.5)
    write_arms(found, tmp_path / "arms.csv")
    with (tmp_path / "arms.csv").open(encoding="utf-8", newline="") as stream:
        lines = {line["arm"]: line for line in csv.DictReader(stream)}
    assert lines["16-x1"]["psnr_less_best"] == "0" and lines["16-x1"]["told_apart"] == "0"
    assert float(lines["256-x1"]["psnr_less_best"]) == pytest.approx(-4, abs=0.1)
    assert lines["256-x1"]["told_apart"] == "1" and lines["16-target-64-x3"]["target_spp"] == "64"
    assert lines["4-two_samples-x3"]["noise"] == "two_samples"
    write_page(study, found, [CostRow(example="0", mix=mix.name, seconds=1.0, wall_seconds=2.0)
                              for mix in study.mixes], "LLVM")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(text in page for text in ("Many examples with noise, or few without?", "Denoised or raw?",
                                         "Which layers deserve samples?", "9 of 10", "0.50 seconds of the processor",
                                         "512 spp, I_s and S&#39; as well as I_t", "<td>weighted loss</td>",
                                         "Do losses that expect noise pay?", "+0.50 ± "))
    assert (tmp_path / "figures" / "budget.png").stat().st_size > 20_000
