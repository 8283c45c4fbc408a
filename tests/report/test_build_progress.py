"""The bars of a build, and the line about every field that it made."""

from dataclasses import replace
from io import StringIO

from rich.console import Console

from dataset_builder.builder import Event
from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.engine.unit import Outcome
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.rendering.field_shelf import FieldProgress
from dataset_builder.report.build_progress import Following, field_line, rate_text
from dataset_builder.shards.manifest import Rejected

RECORD = FieldRecord(key="ab", kind="sdf", truth=True, views=24, held_out=4, width=32, resolution=32, psnr=27.34,
                     psnr_worst=21.0, ssim=0.9, opacity_iou=0.9512, silhouette_iou=0.98, level=0.0, bodies=1,
                     bodies_dropped=0, depth_95=0.02, loss=0.01)


def outcome(index: int) -> Outcome:
    view = ViewRef(number=0, camera=0, pair=PairRef(split="train", object=0, scene=0))
    return Outcome(ref=ExampleRef(index=index, view=view, light=0, level=0), digest="0")


def news(**given: object) -> FieldNews:
    return FieldNews(object="train-chair-00", kind="sdf", key="ab", **given)  # type: ignore[arg-type]


def followed(events: list[Event], told: list[FieldNews]) -> str:
    """What the terminal shows of news that come before the last event."""
    stream = StringIO()
    shown = Following(Console(file=stream, width=160, force_terminal=True))
    found = []
    for event in shown.events(iter(events)):
        found.append(event)
        if len(found) == len(events) - 1:
            for each in told:
                shown.field(each)
                shown.refresh()
    assert found == events
    return stream.getvalue()


def test_progress_counts_to_what_the_build_wants() -> None:
    events = [Event(wanted=3), Event(outcomes=(outcome(0), outcome(1))), Event(), Event(outcomes=(outcome(2),))]
    assert "3/3" in followed(events, [])


def test_progress_of_nothing() -> None:
    assert "0/0" in followed([Event(wanted=0)], [])


def test_a_field_in_the_making_has_a_bar_until_it_is_finished() -> None:
    images = news(progress=FieldProgress(stage="images", step=7, steps=28))
    fit = news(progress=FieldProgress(stage="fit", step=50, steps=300, loss=0.0123, psnr=24.56))
    text = followed([Event(wanted=1), Event(field=news(record=RECORD, seconds={"images": 12.0, "fit": 61.0}))],
                    [images, fit])
    assert "sdf field of train-chair-00: images" in text and "7/28" in text
    assert "50/300" in text and "loss 0.0123, 24.6 dB" in text
    assert "27.3 dB (worst 21.0)" in text


def test_a_line_says_what_became_of_a_field() -> None:
    assert field_line(news(record=RECORD, seconds={"images": 12.0, "fit": 61.0})) == (
        "sdf field of train-chair-00: 27.3 dB (worst 21.0), opacity IoU 0.951, mesh IoU 0.980 in 1 body; "
        "images 12 s, fit 1 min 01 s")
    assert field_line(news(record=RECORD)).endswith("in 1 body; was there")
    assert field_line(news(failed="expected a surface, got none")) == (
        "no sdf field of train-chair-00: expected a surface, got none")


class Clock:
    """Seconds as they are set."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def logged(events: list[Event], seconds: float) -> list[str]:
    """What a log holds of events that come so many seconds apart."""
    stream, clock = StringIO(), Clock()
    for _ in Following(Console(file=stream, width=40), clock=clock).events(iter(events)):
        clock.now += seconds
    return stream.getvalue().splitlines()


def test_a_log_has_a_line_now_and_then_and_one_at_the_end() -> None:
    events = [Event(wanted=100_000), *(Event(outcomes=(outcome(index),)) for index in range(2000))]
    # Half an hour for a fiftieth of the build: a line every 10 minutes
    lines = logged(events, 1.0)
    assert [line.split("/")[0] for line in lines] == ["600", "1200", "1800", "2000"]
    # The same number of examples that are all there is: a line for a percent, and 30 seconds at the least
    assert len(logged([Event(wanted=2000), *events[1:]], 1.0)) in range(60, 69)
    assert len(logged([Event(wanted=2000), *events[1:]], 20.0)) in range(98, 103)
    assert logged([Event(wanted=2), *events[1:3]], 0.5) == ["2/2 examples, 2 s"]
    assert logged([Event(wanted=0)], 0.5) == []


def test_a_log_names_the_first_example_of_a_gate_once() -> None:
    refused = [Outcome(ref=outcome(index).ref, seconds={"plan": 1.0},
                       rejected=Rejected(key=f"{index:08d}", view="train/000000", gate="coverage", reason="got 0.1"))
               for index in range(3)]
    lines = logged([Event(wanted=100), *(Event(outcomes=(each,)) for each in refused)], 60.0)
    assert lines[0] == "first rejected by coverage: 00000000: got 0.1"
    assert "coverage" not in "".join(lines[1:]).replace("(coverage ", "") and "rejected 3 (coverage 3)" in lines[-1]


def test_a_terminal_shows_refusals_and_noise_below_the_bars() -> None:
    made = replace(outcome(0), seconds={"target": 1.0}, noise={"i_t": ("cap", 0.031)}, unknown=("i_t",))
    refused = replace(outcome(1), rejected=Rejected(key="00000001", view="train/000000", gate="coverage",
                                                    reason="got \x1b[2J"))
    text = followed([Event(wanted=2), Event(outcomes=(made, refused)), Event()], [])
    assert "rejected 1 by coverage, first 00000001: got \\x1b[2J" in text
    assert "noise i_t 3.1%" in text and "sampling stopped by cap 100%" in text
    assert "means not known: i_t of 1 example" in text


def test_rates_have_digits_that_say_something() -> None:
    assert [rate_text(rate) for rate in (None, 12.345, 0.07, 0.002)] == ["", "12.35/s", "4.2/min", "7.2/h"]
