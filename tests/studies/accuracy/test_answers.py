"""Answers worked out by hand from laws that are known, and settings that do not follow the noise of timings."""

import math
from dataclasses import replace

import pytest

from dataset_builder.studies.accuracy.answers import ERROR, Answers, AskedAccuracy
from dataset_builder.studies.accuracy.laws import laws
from dataset_builder.studies.accuracy.other_examples import pace_of
from dataset_builder.studies.accuracy.rows import OTHERS
from dataset_builder.studies.accuracy.sampling_advice import RESAMPLED, answer_of, changed_share
from tests.studies.accuracy.made_rows import jittered, sampled, study, work

NOISES = (0.25, 0.5, 1.0, 1.0, 2.0, 4.0)


def answers(rows: list | None = None, examples: int | None = None) -> Answers:
    """Of made rows."""
    return Answers(study(NOISES) if rows is None else rows, work(), "cpu_seconds", first=16, batches=4,
                   dtype="float16", examples=examples)


def test_examples_that_differ_ask_for_more_samples() -> None:
    found = answers()
    spread = found.spread["i_t"]
    assert spread.values == pytest.approx(NOISES) and spread.median == pytest.approx(1)
    # Logarithms of 2: -2, -1, 0, 0, 1, 2, deviation sqrt(2); t(0.95, 5) = 2.0150
    limit = 2 ** (2.0150 * math.sqrt(2) * math.sqrt(7 / 6))
    assert spread.limit == pytest.approx(limit, rel=1e-3)
    answer = found.uniform({"i_t": 0.1, "s_prime": 0.2})
    assert answer is not None
    assert answer.spp == {"target": 4 * math.ceil(limit * 25), "rough": 4 * math.ceil(limit * 25 / 4)}
    assert answer.errors["i_t"][1] <= 0.1 and answer.errors["i_t"][0] == pytest.approx(0.1 / math.sqrt(limit), rel=0.02)


def test_examples_whose_mean_is_not_known_are_counted_alone() -> None:
    rows = [replace(row, unknown=1.0) if row.question == OTHERS and row.example == "00000006" else row
            for row in study((*NOISES, 1e4))]
    spread = answers(rows).spread["i_t"]
    assert spread.values == pytest.approx(NOISES) and (spread.unknown, spread.measured) == (1, 7)
    assert spread.limit == pytest.approx(answers().spread["i_t"].limit)
    all_unknown = [replace(row, unknown=1.0) for row in study(NOISES)]
    spread = answers(all_unknown).spread["i_t"]
    assert spread.values == pytest.approx(NOISES) and (spread.unknown, spread.measured) == (6, 6)


def test_goals_take_what_each_example_needs() -> None:
    answer = answers().goals({"i_t": 0.1})
    assert answer is not None and answer.goals == {"i_t": 0.2}
    # 100 samples for a noise of 1, and never fewer than the first round
    assert answer.spp["target"] == pytest.approx(sum(max(100 * noise, 16) for noise in NOISES) / 6, rel=1e-3)
    assert answer.cap >= 2 * 100 * max(NOISES) and math.log2(answer.cap).is_integer()


def test_goals_that_nobody_may_ask_for_are_not_advised() -> None:
    assert answers().goals({"i_t": 0.6}) is None and answers().goals({"i_t": 0.4}) is not None


def test_goals_are_chosen_where_they_are_clearly_cheaper() -> None:
    assert getattr(answers().of_errors(AskedAccuracy()), "way", "") == "adaptive"
    assert getattr(answers(study((1.0,) * 4)).of_errors(AskedAccuracy()), "way", "") == "uniform"
    slow = [replace(row, cpu_seconds=6 * row.cpu_seconds) if row.question == "adaptive" else row
            for row in study(NOISES)]
    assert getattr(answers(slow).of_errors(AskedAccuracy()), "way", "") == "uniform"
    rows = [row for row in study(NOISES) if row.question != "adaptive"]
    assert getattr(answers(rows).of_errors(AskedAccuracy()), "way", "") == "uniform"


def test_goals_whose_law_is_not_known_are_not_recommended() -> None:
    """Two goals, run once each, and the error of one is half off: t(0.975, 1) is 12.7, so that the interval holds 0."""
    rows = [row for row in study(NOISES, runs=1) if row.question != "adaptive" or row.value > 0.1]
    off = [replace(row, relmse_measured=row.relmse_measured / 2) if row.question == "adaptive" and row.value == 0.2
           else row for row in rows]
    assert answers(rows).goals_known and not answers(off).goals_known
    assert answers(off).goals({"i_t": 0.1}) is not None
    assert getattr(answers(off).of_errors(AskedAccuracy()), "way", "") == "uniform"


def test_hours_and_bytes_by_hand() -> None:
    # Per example: 1 s besides, three passes of 0.05 s, two of 100 spp at 1/100 s, source as it is, 64 spp
    answer = answers().fixed({"target": 100, "rough": 100})
    assert answer.core_hours * 3600 == pytest.approx(100 * (1 + 3 * 0.05 + 2.64), rel=0.02)
    assert answer.gigabytes == 1 and answer.within >= 0
    many = answers(examples=12_000).fixed({"target": 100, "rough": 100})
    assert many.core_hours == pytest.approx(120 * answer.core_hours) and many.gigabytes == pytest.approx(120)


def test_hours_surely_buy_the_least_error_of_a_series_in_the_ratios_asked() -> None:
    found, asked = answers(), AskedAccuracy(errors={"i_t": 0.05, "s_prime": 0.1}, hours=1.0)
    answer, finer = found.of_hours(asked, workers=2)
    assert answer is not None and finer is not None
    assert answer.core_hours * (1 + answer.within) / 2 <= 1 < finer.core_hours * (1 + finer.within) / 2
    errors, less = ({layer: limit for layer, (_, limit) in one.errors.items()} for one in (answer, finer))
    assert errors["s_prime"] == pytest.approx(2 * errors["i_t"]) and 1.2 < errors["i_t"] / less["i_t"] < 1.3
    # Hours that are no more than what is likely are not surely enough
    just = replace(asked, hours=1.001 * finer.core_hours / 2)
    assert found.of_hours(just, workers=2)[0] == answer
    assert found.of_hours(AskedAccuracy(hours=1e-3), workers=2)[0] is None


def test_what_no_samples_reach_has_no_answer() -> None:
    rows = [row if row.question != "uniform" else
            type(row)(**{**vars(row), "relmse": row.relmse + 0.04, "relmse_measured": row.relmse_measured + 0.04})
            for row in study(NOISES)]
    found = answers(rows)
    assert found.floor("i_t") == pytest.approx(0.04, rel=1e-3)
    assert found.uniform({"i_t": 0.1}) is None and found.uniform({"i_t": 0.3}) is not None


def test_what_is_not_asked_is_a_tenth() -> None:
    assert AskedAccuracy(errors={"i_t": 0.05}).error_of("s_prime") == ERROR == 0.1


def test_settings_for_an_error_do_not_follow_the_noise_of_timings() -> None:
    """The advice by knees changed in 229 of 300 resamplings of the timings of a real study."""
    assert changed_share(study(NOISES), answers, AskedAccuracy(errors={"i_t": 0.05}), workers=2) == 0
    assert RESAMPLED >= 100


def test_other_timings_are_other_hours_and_the_same_settings() -> None:
    plain, slow = (answer_of(answers(jittered(study(NOISES), deviation, 3)), AskedAccuracy(), 2)
                   for deviation in (0.0, 0.05))
    assert plain is not None and slow is not None
    assert (plain.spp, plain.goals, plain.way) == (slow.spp, slow.goals, slow.way)
    assert slow.core_hours == pytest.approx(plain.core_hours, rel=0.1) and slow.core_hours != plain.core_hours


def test_hours_that_buy_nothing_below_all_of_the_light_buy_nothing() -> None:
    found = answers(study(tuple(400 * noise for noise in NOISES)))
    bought = [found.of_hours(AskedAccuracy(hours=0.03 * 1.1**step), workers=2)[0] for step in range(60)]
    assert None in bought and bought[-1] is not None
    assert all(limit < 1 for answer in bought if answer for _, limit in answer.errors.values())


def test_seconds_per_path_are_a_ratio_of_sums_by_hand() -> None:
    """10,000 paths in 1 s and 30,000 in 1.5 s, besides 0.05 s each: 2.5 s for 40,000, not the mean of both paces."""
    rows = [row for row in study() if row.question == "uniform"]
    rows += [sampled(OTHERS, 10, example="a"), replace(sampled(OTHERS, 30, example="b"), paths=30_000)]
    rows = [replace(row, cpu_seconds=0.05 + {"a": 1.0, "b": 1.5}[row.example]) if row.question == OTHERS else row
            for row in rows]
    pace, error = pace_of(rows, laws(rows, "cpu_seconds"), "i_t", "cpu_seconds")
    assert pace == pytest.approx(2.5 / 40_000, rel=1e-3)
    # What is left of either is 3 / 8 s; its standard error, over the mean of 20,000 paths
    assert error == pytest.approx(math.sqrt(2 * 0.375**2 / 1 / 2) / 20_000, rel=2e-3)
