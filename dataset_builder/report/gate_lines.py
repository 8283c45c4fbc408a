"""Terminal output of a release gate: parts as they begin and end, a line per check, a bar while training."""

from collections.abc import Iterable, Iterator

from rich.console import Console

from dataset_builder.lightnet.training.events import Started, Stepped
from dataset_builder.release.dataset_check import Check
from dataset_builder.release.gate import Begun, Done, LeftOut, News
from dataset_builder.report.training import bar_of_steps, lines_of, step_text

MARKS = {"yes": "yes", "no": "NO ", "not judged": " - "}
NAME = 20
"""Columns of a check's name."""


def follow(news: Iterable[News], console: Console) -> Iterator[News]:
    """Pass news on while the terminal shows them."""
    with bar_of_steps(console) as progress:
        bar = progress.add_task("", total=None, text="", visible=False)
        for one in news:
            if isinstance(one, Started):
                progress.update(bar, total=one.steps, completed=one.first, visible=True)
                progress.reset(bar, total=one.steps, completed=one.first)
            if isinstance(one, Stepped):
                progress.update(bar, completed=one.step, text=step_text(one))
            for line in lines(one):
                progress.console.print(line, highlight=False, markup=False, soft_wrap=True)
            yield one


def lines(news: News) -> list[str]:
    """Lines that stay."""
    if isinstance(news, Begun):
        return [f"{news.part}:"]
    if isinstance(news, Done):
        checks = [check_line(check) for check in news.found.checks]
        return [*checks, f"  {news.part} took {news.seconds:.1f} s"]
    if isinstance(news, LeftOut):
        return [f"not run, because an earlier part failed: {', '.join(news.parts)} (use --all to run every part)"]
    return [f"  {line}" for line in lines_of(news)]


def check_line(check: Check) -> str:
    """Verdict, name, value, bounds, and what helps."""
    value = figure(check.value) if check.value is not None else "not judged"
    detail = f"  {check.detail}" if check.detail else ""
    return f"  {MARKS[check.verdict]} {check.name:<{NAME}} {value:>10}  ({check.rule.bounds}){detail}"


def figure(value: float) -> str:
    """Whole numbers whole, others with three significant digits."""
    return f"{value:.0f}" if float(value).is_integer() else f"{value:.3g}"
