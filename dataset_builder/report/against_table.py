"""What a build would run again, as a table and as one line."""

from rich.markup import escape
from rich.table import Table

from dataset_builder.engine.against import Against
from dataset_builder.engine.outcomes import Tally
from dataset_builder.files import size_text
from dataset_builder.rendering.pass_inputs import RUNS


def against_table(found: Against) -> Table:
    """Runs of every pass, out of those of a build from nothing, and what changed."""
    title = f"{found.kept} of {found.examples} examples are published as they are"
    table = Table("pass", "runs", "of", "what changed", title=title, title_justify="left")
    for name, runs in found.passes.items():
        changed = ", ".join(f"{topic} ({count})" for topic, count in runs.changed.most_common())
        table.add_row(name, str(runs.runs), str(runs.total), escape(changed))
    if found.unplanned:
        table.add_row("cannot be planned", "", "", f"{found.unplanned} examples", style="red")
    return table


def runs_line(tally: Tally, kept: int | None) -> str:
    """How many passes a build ran, how many it had the results of, and the bytes that it keeps of all; None where other
    machines keep them."""
    ran = sum(count for name, count in tally.runs.items() if name in RUNS)
    size = "their machines keep the results" if kept is None else \
        f"{size_text(kept)} of results are kept (--cache-size)" if kept else "no results are kept"
    return f"passes: {ran} ran, {tally.recalled} were known from an earlier build; {size}"
