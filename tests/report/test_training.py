"""What the terminal says of a training."""

from collections.abc import Iterator
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from dataset_builder.errors import UserError
from dataset_builder.lightnet.training.events import Checked, Event, Finished, Started, Stepped
from dataset_builder.report.training import follow, lines_of, step_text

STARTED = Started(parameters={"generator": 1200, "discriminator": 34}, first=7, steps=20, train=64, held_out=16,
                  device="cpu", precision="float32", off=("fr: no weights",), notes=("split train: 1 left out",))
STEPPED = Stepped(step=8, loss={"main": 0.5}, terms={"dr": 0.25, "lab": 0.5}, norm=1.0, rate=1e-3, skipped="", images=8,
                  seconds=2.0, waited=0.5)
BAD = Stepped(step=9, loss={"main": float("nan")}, terms={}, norm=0.0, rate=1e-3, skipped="main: not finite", images=8,
              seconds=1.0, waited=0.0)
CHECKED = Checked(step=10, metrics={"l1": 0.05, "psnr": 23.5}, examples=16, best=True, stale=0)
FINISHED = Finished(step=20, reason="patience", best=(10, 23.5), bad_steps=1, last_file=Path("a/last.pt"),
                    best_file=Path("a/best.pt"))


def test_lines_that_stay() -> None:
    assert lines_of(STARTED) == [
        "parameters: generator 1,200, discriminator 34; 64 examples to train on, 16 held out; cpu, float32",
        "split train: 1 left out", "off: fr: no weights", "resuming after step 7"]
    assert lines_of(STEPPED) == []
    assert lines_of(BAD) == ["step 9 skipped: main: not finite"]
    assert lines_of(CHECKED) == ["step 10, 16 held-out examples: l1 0.0500, psnr 23.5000 (best)"]
    assert lines_of(FINISHED) == ["no better check within the patience at step 20, 1 steps skipped; best on held-out "
                                  "examples: 23.50 dB at step 10", "last: a/last.pt", "best: a/best.pt"]


def test_the_bar_has_losses_rate_and_waiting() -> None:
    assert step_text(STEPPED) == "dr 0.2500 lab 0.5000  4.0 images/s  25% waiting"


def test_eighty_columns_hold_steps_time_and_losses() -> None:
    """Of a text beside the bar, or of a bar that gives way, something was cut."""
    out = StringIO()
    many = replace(STEPPED, step=1200, terms={"dr": 0.25, "fr": 0.5, "dssim": 0.125, "lab": 0.5, "l1": 0.0625})
    list(follow([replace(STARTED, steps=100_000), many], Console(file=out, width=80), lines_of))
    text = out.getvalue()
    assert " 1200/100000 " in text and " left " in text
    assert "dr 0.2500 fr 0.5000 dssim 0.1250 lab 0.5000 l1 0.0625  4.0 images/s  25% waiting" in text.splitlines()
    assert "…" not in text


def test_what_is_wrong_before_the_first_event_is_told_without_a_bar() -> None:
    def refused() -> Iterator[Event]:
        raise UserError("no dataset")
        yield STARTED

    out = StringIO()
    with pytest.raises(UserError):
        list(follow(refused(), Console(file=out, width=80), lines_of))
    assert out.getvalue() == ""


def test_a_training_that_was_finished_does_not_go_on() -> None:
    assert not [line for line in lines_of(replace(STARTED, first=20)) if "going on" in line]


def test_events_pass_in_order_and_their_lines_are_printed() -> None:
    out = StringIO()
    events = [STARTED, STEPPED, BAD, CHECKED, FINISHED]
    assert list(follow(events, Console(file=out, width=200), lines_of)) == events
    text = out.getvalue()
    for event in events:
        for line in lines_of(event):
            assert line in text
