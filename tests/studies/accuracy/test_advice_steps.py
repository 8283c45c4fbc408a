"""How often the noise of timings changes the settings, over asked hours and errors, for the table of docs/accuracy.md.

`pytest -s` prints the figures that the page names.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from dataset_builder.studies.accuracy.answers import SERIES, Answer, Answers, AskedAccuracy
from dataset_builder.studies.accuracy.conclusions import Conclusions
from dataset_builder.studies.accuracy.sampling_advice import JITTER
from tests.studies.accuracy.made_rows import jittered
from tools import accuracy_docs

ASKED, DRAWS, WORKERS = 60, 50, 2
HOURS = np.geomspace(2, 60, ASKED).tolist()


@dataclass(frozen=True)
class Timed:
    """Answers by the timings that were measured, and by as many others as `DRAWS` of 5% noise."""

    asked: AskedAccuracy
    own: Answers
    others: Sequence[Answers]
    bought: Sequence[tuple[Answer | None, Sequence[Answer | None]]]
    """By those and by these, for each of `HOURS`."""


@pytest.fixture(scope="module")
def timed() -> Timed:
    """Of the page's table."""
    found = accuracy_docs.conclusions()

    def of(seed: int, deviation: float) -> Answers:
        return Conclusions.of(jittered(found.rows, deviation, seed), found.spec, found.work, found.setup,
                              found.asked).answers

    own, others = of(0, 0.0), [of(seed, JITTER) for seed in range(DRAWS)]

    def buys(one: Answers, hours: float) -> Answer | None:
        return one.of_hours(replace(found.asked, hours=hours), WORKERS)[0]

    return Timed(found.asked, own, others, [(buys(own, hours), [buys(one, hours) for one in others])
                                            for hours in HOURS])


def settings(answer: Answer | None) -> tuple[object, ...]:
    """What is recommended."""
    return (answer.way, *sorted(answer.spp.items()), *sorted(answer.goals.items())) if answer else ()


def error(answer: Answer) -> float:
    """The largest of its layers."""
    return max(limit for _, limit in answer.errors.values())


def changed(own: Answer | None, others: Sequence[Answer | None]) -> float:
    """Share of the draws that change an answer."""
    return float(np.mean([settings(other) != settings(own) for other in others]))


def told(what: str, shares: Sequence[float]) -> None:
    """The figures of the page."""
    print(f"{what}: changed in {np.mean(shares):.1%} of all resamplings, at most in {max(shares):.0%}; in more than 5% "
          f"of them at {np.mean(np.array(shares) > 0.05):.0%} of {len(shares)}")


def test_settings_for_hours_change_only_at_steps(timed: Timed) -> None:
    """A draw changes the answer at the share of all hours by which it moves the steps, over how far they are apart.
    That is what it does to the logarithm of an answer's hours, upper ends of intervals, over what one step of the
    series does: 1.4% of 5%, as many timings are averaged, over 29%."""
    shares = [changed(own, others) for own, others in timed.bought]
    told("asked hours", shares)
    errors = [step / 1000 for step in range(30, 200, 10)]

    def logs(one: Answers, times: float = 1.0) -> np.ndarray:
        found = [one.uniform(dict.fromkeys(one.layers, times * each)) for each in errors]
        return np.log([answer.longest for answer in found if answer])

    moved = float(np.mean([np.abs(logs(one) - logs(timed.own)) for one in timed.others]))
    apart = float(np.mean(logs(timed.own) - logs(timed.own, SERIES[1])))
    print(f"hours move by {moved:.1%}, steps are {apart:.0%} apart: {moved / apart:.1%} of all hours expected")
    # 60 hours sample about ten steps: the mean over them is within half of what is expected
    assert np.mean(shares) == pytest.approx(moved / apart, rel=0.5) and np.mean(shares) < 0.08
    assert float(np.median(shares)) <= 0.01


def test_either_answer_at_a_step_is_the_next_and_within_the_hours(timed: Timed) -> None:
    largest = max(map(timed.asked.error_of, timed.own.layers))
    for hours, (own, others) in zip(HOURS, timed.bought, strict=True):
        for other in others:
            assert own is not None and other is not None
            assert abs(math.log(error(other) / error(own))) < 1.5 * math.log(SERIES[1])
            if settings(other) != settings(own):
                # What it takes by the timings that were measured, not by those that it was found with
                there = timed.own.of_errors(timed.asked, error(other) / largest)
                assert there is not None and there.core_hours / WORKERS <= hours


def test_settings_for_errors_hardly_ever_change(timed: Timed) -> None:
    shares = []
    for each in np.geomspace(0.02, 0.5, ASKED).tolist():
        asked = AskedAccuracy(errors=dict.fromkeys(timed.own.layers, each))
        shares.append(changed(timed.own.of_errors(asked), [one.of_errors(asked) for one in timed.others]))
    told("asked errors", shares)
    assert np.mean(shares) < 0.02 and float(np.median(shares)) == 0
