"""What the terminal shows: tables, and hard cases as they are done."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from dataset_builder.engine.outcomes import Tally
from dataset_builder.engine.rejected_pixels import pixels_of
from dataset_builder.errors import count_of, printable
from dataset_builder.files import size_text
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.cost import CostEstimate
from dataset_builder.planning.fleet import Fleet, bill
from dataset_builder.report.decision_rows import decision_rows
from dataset_builder.report.doctor import Finding
from dataset_builder.shards.manifest import Manifest, Rejected
from dataset_builder.studies.stress.case import CaseResult

NAME, NUMBER, VERDICT = 31, 10, 7
"""Widths of columns; the expectation takes what is left."""
MOST_REASONS = 3
"""Reasons why views cannot be planned that are printed."""
MOST_REJECTED = 20
"""Rejected examples of a gate that have a line each."""


def rejected_lines(rejected: Iterable[Rejected], folder: Path) -> list[str]:
    """A line for each of the first examples that every gate refused: its key, the gate, the figures, and where its
    pixels are; then a line with the number of the others."""
    lines, counts = list[str](), Counter[str]()
    for item in rejected:
        counts[item.gate] += 1
        if counts[item.gate] <= MOST_REJECTED:
            pixels = pixels_of(folder, item.key)
            lines.append(f"rejected {item.key} ({item.gate}): {item.reason}"
                         + (f" (pixels: {pixels})" if pixels else ""))
    return lines + [f"rejected {count - MOST_REJECTED} more ({gate})" for gate, count in counts.items()
                    if count > MOST_REJECTED]


def finding_table(findings: Sequence[Finding]) -> Table:
    """The doctor's report."""
    table = Table("what", "found", "what to do")
    for finding in findings:
        table.add_row(finding.what, finding.value, finding.mend, style="red" if finding.mend else None)
    return table


def estimate_table(estimate: CostEstimate, fleet: Fleet) -> Table:
    """The cost of a dataset on a fleet, with its standard error where it was extrapolated, and what is paid where it is
    known."""
    table = Table("what", "planned", title=f"{estimate.examples} examples in {estimate.views} views, "
                                           f"{estimate.planned} of them planned in full", title_justify="left")
    if failed := estimate.tried - estimate.planned:
        reasons = [str(problem) for problem in estimate.problems]
        more = [f"and {len(reasons) - MOST_REASONS} more"] if len(reasons) > MOST_REASONS else []
        table.add_row("cannot be planned", "\n".join([
            f"{failed} of the {estimate.tried} views tried cannot be planned", *reasons[:MOST_REASONS], *more]),
            style="red")
    for warning in estimate.warnings:
        table.add_row("warning", warning, style="red")
    for name, count in estimate.runs.items():
        table.add_row(f"passes: {name}", f"{count}")
    if (fields := estimate.field_cost).count:
        table.add_row("fields", f"{fields.count}, {fields.known} of them made already; the others take "
                                f"{fields.images:,} images, {duration(fields.seconds)} and "
                                f"{size_text(fields.bytes)} beside the dataset")
    total, error = estimate.total, estimate.error
    for label in ("passes", "pixels", "paths"):
        table.add_row(label, f"{getattr(total, label):,.4g}{_plus_minus(getattr(error, label))}")
    paid = bill(estimate, fleet)
    table.add_row(*_time_row(fleet, f"{duration(paid.seconds)}" + f" ± {duration(paid.error)}" * (paid.error >= 0.5)))
    table.add_row("size", size_text(total.bytes, error.bytes))
    if fleet.price:
        table.add_row("price", f"{paid.money:,.2f} for {paid.worker_hours:,.1f} worker-hours")
    if fleet.egress:
        table.add_row("egress", f"{paid.egress:,.2f} for {size_text(total.bytes)}")
    return table


def _time_row(fleet: Fleet, time: str) -> tuple[str, str]:
    """The time on a fleet; on GPUs only where their speed is given."""
    kind = "GPU" if fleet.gpu else "worker"
    pace = f" of speed {fleet.speed:g}" if fleet.speed and (fleet.gpu or fleet.speed != 1) else ""
    if fleet.gpu and not fleet.speed:
        time = (f"not predicted: rates are those of a CPU core, and none of a GPU is known; "
                f"{count_of(fleet.workers, 'core')} would take {time}. Say how many times as fast a GPU is: --speed X")
    return f"time on {count_of(fleet.workers, kind)}{pace}", time


def files_table(files: Mapping[str, Sequence[tuple[str, str]]]) -> Table:
    """What every mesh file contains, and what became of it. Files of which the same is told share a row."""
    table = Table("file", "what it contains, and what became of it", title="Mesh and scene files", title_justify="left",
                  show_lines=True)
    rows = dict[tuple[str, ...], list[str]]()
    for name, told in files.items():
        lines = (said if word == "contains" else f"{word}: {said}" for word, said in told)
        rows.setdefault(tuple(lines), []).append(name)
    for found, names in rows.items():
        table.add_row(cell(*names), cell(*found))
    return table


def cell(*lines: str) -> Text:
    """Text as files have it, but for control characters, in lines that are folded rather than cut."""
    return Text("\n".join(map(printable, lines)), overflow="fold")


def decisions_table(plan: ExamplePlan) -> Table:
    """What an example's passes simulate and why, and what was decided about it; `files_table` tells of its scene."""
    title = f"What is simulated: example {plan.key}, {plan.target.object.name} in {plan.room.name}"
    table = Table("effect", "choice", "why", title=title, title_justify="left")
    for row in decision_rows(plan):
        table.add_row(*map(cell, row))
    return table


def build_table(manifest: Manifest, tally: Tally, seconds: float) -> Table:
    """What a build made, and what its time went into."""
    table = Table("split", "examples", "shards", title=manifest.name, title_justify="left")
    for split in manifest.splits:
        table.add_row(split.name, str(split.examples), str(len(split.shards)))
    if manifest.totals.rejected:
        table.add_row("rejected", f"{manifest.totals.rejected}", "", style="red")
    table.add_row("all", f"{manifest.totals.examples}", f"{manifest.totals.shards}", end_section=True)
    table.add_row("size", size_text(manifest.totals.bytes), "")
    table.add_row("time", duration(seconds), f"{tally.paths / max(seconds, 1e-9) / 1e6:.2f} M paths/s")
    for name, spent in tally.seconds.most_common():
        table.add_row(f"  {name}", f"{spent:.1f} s", "")
    return table


def duration(seconds: float) -> str:
    """Seconds for people: `42 s`, `3 min 05 s`, `7 h 30 min`."""
    minutes, rest = divmod(round(seconds), 60)
    if not minutes:
        return f"{rest} s"
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def _plus_minus(deviation: float) -> str:
    return f" ± {deviation:,.2g}" if deviation else ""


def case_header() -> Table:
    """Names of the columns."""
    return _case_row(*(Text(word, style="bold") for word in ("case", "expectation", "measured", "bound", "verdict")))


def case_line(result: CaseResult) -> Table:
    """One result."""
    style = "green" if result.passed else "bold red"
    verdict = Text("passed" if result.passed else "failed", style=style)
    return _case_row(Text(result.case.name), Text(result.case.expectation), Text(f"{result.figure:.3g}"),
                Text(f"{result.case.bound:g}"), verdict)


def show_case(result: CaseResult, console: Console) -> None:
    """Print a result and, where it failed, what was measured and which laws are broken."""
    console.print(case_line(result))
    if not result.passed:
        for reason in result.wrong or (f"{result.case.figure}: expected at most {result.case.bound:g}, got "
                                       f"{result.figure:g}",):
            console.print(Text(f"  {reason}", style="red"), soft_wrap=True)


def _case_row(*cells: Text) -> Table:
    table = Table.grid(padding=(0, 1), expand=True)
    for width in (NAME, None, NUMBER, NUMBER, VERDICT):
        table.add_column(width=width, ratio=None if width else 1, justify="right" if width == NUMBER else "left")
    table.add_row(*cells)
    return table
