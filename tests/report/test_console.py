"""What the terminal shows of builds, specs and trainings."""


from collections.abc import Iterable, Iterator
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from dataset_builder.assets.procedural.furniture import FINISHES
from dataset_builder.builder import Event
from dataset_builder.cli.common import plain_console
from dataset_builder.engine.outcomes import Tally
from dataset_builder.engine.rejected_pixels import keep_pixels
from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import ShardError, UserError
from dataset_builder.files import size_text
from dataset_builder.label.example_plan import Decision
from dataset_builder.lightnet.training.events import Checked, Finished, Started, Stepped
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.planning.cost import estimate
from dataset_builder.planning.fleet import Fleet
from dataset_builder.planning.plan import Planner
from dataset_builder.report.console import (
    build_table,
    decisions_table,
    duration,
    estimate_table,
    rejected_lines,
)
from dataset_builder.report.dataset_summary import summary_tables
from dataset_builder.report.spec_help import family_tables
from dataset_builder.report.training_lines import follow_training, lines_of, step_text
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.reader import load_manifest
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.load import load_dataset
from tests.plans import example_plan


def printed(tables: Iterable[Table]) -> str:
    """Tables as text, on a wide terminal."""
    stream = StringIO()
    console = Console(file=stream, width=240)
    for table in tables:
        console.print(table)
    return stream.getvalue()


def row(text: str, name: str) -> list[str]:
    """Cells of the row that begins with `name`."""
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in text.splitlines() if line.startswith("│")]
    found, = (cells for cells in rows if cells[0] == name)
    return found[1:]


def outcome(index: int, **seconds: float) -> Outcome:
    view = ViewRef(number=0, camera=0, pair=PairRef(split="train", object=0, scene=0))
    return Outcome(ref=ExampleRef(index=index, view=view, light=0, level=0), digest="0", rejected=None, kept=False,
                   paths=1_000_000, seconds=seconds)


@pytest.mark.parametrize(("seconds", "text"), [
    (0.2, "0 s"), (42.4, "42 s"), (59.6, "1 min 00 s"), (60, "1 min 00 s"), (185, "3 min 05 s"), (3599.7, "1 h 00 min"),
    (27_000, "7 h 30 min"), (100_000, "27 h 46 min")])
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_what_a_build_made(small_dataset: Path) -> None:
    manifest = load_manifest(small_dataset)
    outcomes = [outcome(0, source=2.0, rough=0.5), outcome(1, rough=1.25)]
    tally = Tally()
    tally.add(outcomes)
    assert tally.seconds == {"source": 2.0, "rough": 1.75} and tally.runs == {"source": 1, "rough": 2}
    text = printed([build_table(manifest, tally, 4.0)])
    assert row(text, "train") == ["8", "4"] and row(text, "test") == ["2", "2"] and row(text, "all") == ["10", "6"]
    assert row(text, "time") == ["4 s", "0.50 M paths/s"]
    assert row(text, "source") == ["2.0 s", ""] and text.index("source") < text.index("rough")
    assert "rejected" not in text
    totals = manifest.totals.model_copy(update={"rejected": 2})
    short = manifest.model_copy(update={"totals": totals})
    assert row(printed([build_table(short, Tally(), 0.0)]), "rejected") == ["2", ""]


def test_rejected_examples_are_lines(tmp_path: Path) -> None:
    item = Rejected(key="00000007", view="train/000003", gate="coverage", reason="expected more, got 0.1")
    assert rejected_lines([item], tmp_path) == ["rejected 00000007 (coverage): expected more, got 0.1"]
    keep_pixels(tmp_path, item.key, {"i_s": np.zeros((2, 3, 3), np.float32)})
    assert rejected_lines([item], tmp_path) == [
        f"rejected 00000007 (coverage): expected more, got 0.1 (pixels: {tmp_path}/.build/rejected/00000007.npz)"]


def test_thousands_of_rejected_examples_are_few_lines(tmp_path: Path) -> None:
    many = [Rejected(key=f"{number:08d}", view="train/000003", gate="coverage" if number % 10 else "planning",
                     reason="expected more") for number in range(5000)]
    lines = rejected_lines(many, tmp_path)
    assert len(lines) == 42 and len(set(lines)) == 42
    assert lines[-2:] == ["rejected 480 more (planning)", "rejected 4480 more (coverage)"]


def test_what_a_dataset_will_cost(small_spec: Path) -> None:
    text = printed([estimate_table(estimate(Planner(load_dataset(small_spec)), views=3), Fleet(workers=2))])
    assert "10 examples in 3 views, 3 of them planned in full" in " ".join(text.split())
    # Three views: source, light-free and instances each; five targets, both levels under each
    assert [row(text, f"passes: {name}") for name in ("source", "target", "rough", "first_hit", "first_hit_rough",
                                                     "instance")] == [["3"], ["5"], ["10"], ["3"], ["10"], ["3"]]
    assert "cannot be planned" not in text
    assert row(text, "passes") == ["34"] and "KiB" in row(text, "size")[0]


def test_what_is_paid_is_told_where_it_is_known(small_spec: Path) -> None:
    found = estimate(Planner(load_dataset(small_spec)), views=3, cores=2)
    text = printed([estimate_table(found, Fleet(workers=2))])
    assert "price" not in text and "egress" not in text
    text = " ".join(printed([estimate_table(found, Fleet(workers=2, speed=4, price=3, egress=1000))]).split())
    hours = found.total.seconds / 4 / 3600
    assert "time on 2 workers of speed 4" in text
    assert f"{2 * hours * 3:,.2f} for {2 * hours:,.1f} worker-hours" in text
    assert f"{found.total.bytes / 1e6:,.2f} for {size_text(found.total.bytes)}" in text


def test_the_time_on_a_gpu_is_predicted_where_its_speed_is_given(small_spec: Path) -> None:
    """No rate of a GPU is known: what cores would take is told, and how to say more."""
    found = estimate(Planner(load_dataset(small_spec)), views=3, cores=1)
    cell, = row(printed([estimate_table(found, Fleet(workers=1, gpu=True))]), "time on 1 GPU")
    assert cell.startswith("not predicted: rates are those of a CPU core") and "--speed X" in cell
    assert f"1 core would take {duration(found.total.seconds)}" in cell
    text = printed([estimate_table(found, Fleet(workers=3, gpu=True, speed=0.5))])
    assert row(text, "time on 3 GPUs of speed 0.5")[0].startswith(duration(found.total.seconds / 0.5))


def test_views_from_one_side_alone_are_told(small_spec: Path) -> None:
    """As many as there are, or as a sample of them; the small dataset's own cameras go round."""
    views = ["splits.train.views=3", "camera.coverage=[0.02, 0.5]", "camera.visibility=0.2"]
    told = []
    for camera in ([], ["camera.azimuth=30", "camera.elevation=20"]):
        planner = Planner(load_dataset(small_spec, [*views, *camera]))
        told.append("warning" in printed([estimate_table(estimate(planner, views=100), Fleet(workers=1))]))
    assert told == [False, True]


def test_views_that_cannot_be_planned_are_told(small_spec: Path) -> None:
    planner = Planner(load_dataset(small_spec, ["camera.attempts=1", "splits.train.views=8"]))
    found = estimate(planner, views=100)
    failed = found.tried - found.planned
    assert 0 < failed < found.tried and len(found.problems) == failed
    text = " ".join(printed([estimate_table(found, Fleet(workers=2))]).split())
    assert f"{failed} of the {found.tried} views tried cannot be planned" in text
    assert "expected a camera" in text and str(found.problems[0].where) in text


def test_a_dataset_in_tables(small_dataset: Path, tmp_path: Path) -> None:
    text = printed(summary_tables(small_dataset))
    assert row(text, "train") == ["8", "2", "1", "cabinet 4, nightstand 4"] or \
        row(text, "train") == ["8", "2", "1", "nightstand 4, cabinet 4"]
    assert row(text, "test") == ["2", "1", "1", "ottoman 2"]
    assert row(text, "s_prime")[:2] == ["object", "float32"] and row(text, "s_prime")[-1].endswith("%")
    assert row(text, "d")[-1] == "" and float(row(text, "mask")[-2]) == 1
    with pytest.raises(ShardError, match="expected a finished dataset"):
        summary_tables(tmp_path)


def test_decisions_in_a_table() -> None:
    plan = example_plan()
    decision = Decision(effect="lights of rough", choice="1 of 2", reason="dome [left out]: no way in")
    scene = [Decision(effect="scene file", choice=choice, reason=reason) for choice, reason in (
        ("contains", "14 things"), ("taken away", "Chair"))]
    effects = plan.effects.model_copy(update={"decisions": (decision, *scene)})
    plan = plan.model_copy(update={"effects": effects, "notes": ("a [note]",)})
    text = printed([decisions_table(plan)])
    assert row(text, "lights of rough") == ["1 of 2", "dome [left out]: no way in"]
    assert row(text, "note")[-1] == "a [note]"
    assert row(text, "scene file") == ["taken away", "Chair"] and "14 things" not in text
    assert plan.key in text and plan.target.object.name in text


def test_families_tell_the_names_of_their_materials() -> None:
    text = printed(family_tables("cabinet")[1:])
    assert [row(text, name) for name in FINISHES["cabinet"]]
    assert "paint" in row(text, "front")[0]


def test_families_in_tables() -> None:
    text = printed(family_tables(None))
    assert all(row(text, name)[0] == family.summary for name, family in FAMILIES.items())
    width = FAMILIES["chair"].param("width")
    assert row(printed(family_tables("chair")), "width")[:2] == [width.unit, f"{width.low:g} to {width.high:g}"]
    with pytest.raises(UserError, match=r"family: expected one of chair, .* got chiar"):
        family_tables("chiar")


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
    known = replace(CHECKED, corrected={"psnr": 24.0}, ceiling={"psnr": 30.0}, best=False)
    assert lines_of(known) == ["step 10, 16 held-out examples: l1 0.0500, psnr 23.5000; without noise: psnr 24.0000; "
                               "noise ceiling: psnr 30.0000"]
    assert lines_of(FINISHED) == ["no better check within the patience at step 20, 1 steps skipped; best on held-out "
                                  "examples: 23.50 dB at step 10", "last: a/last.pt", "best: a/best.pt"]


def test_the_bar_has_losses_rate_and_waiting() -> None:
    assert step_text(STEPPED) == "dr 0.2500 lab 0.5000  4.0 images/s  25% waiting"


def test_eighty_columns_hold_steps_time_and_losses() -> None:
    """Of a text beside the bar, or of a bar that gives way, something was cut."""
    out = StringIO()
    many = replace(STEPPED, step=1200, terms={"dr": 0.25, "fr": 0.5, "dssim": 0.125, "lab": 0.5, "l1": 0.0625})
    list(follow_training([replace(STARTED, steps=100_000), many], Console(file=out, width=80), lines_of))
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
        list(follow_training(refused(), Console(file=out, width=80), lines_of))
    assert out.getvalue() == ""


def test_a_training_that_was_finished_does_not_go_on() -> None:
    assert not [line for line in lines_of(replace(STARTED, first=20)) if "going on" in line]


def test_events_pass_in_order_and_their_lines_are_printed() -> None:
    out = StringIO()
    events = [STARTED, STEPPED, BAD, CHECKED, FINISHED]
    assert list(follow_training(events, Console(file=out, width=200), lines_of)) == events
    text = out.getvalue()
    for event in events:
        for line in lines_of(event):
            assert line in text


@pytest.mark.parametrize("text", ["[/]", "[red]x[/red]", ":smile:", "[link=x]y"])
def test_names_are_no_markup(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("what", title=text)
    table.add_row(text)
    for thing in (text, table):
        plain_console(80).print(thing)
    assert capsys.readouterr().out.count(text) == 3
