"""Terminal output of a release gate: parts as they begin and end, and a line per check."""

from dataset_builder.release.dataset_check import Check
from dataset_builder.release.gate import Begun, Done, LeftOut, News
from dataset_builder.report.training import lines_of

MARKS = {"yes": "yes", "no": "NO ", "not judged": " - "}
NAME = 20
"""Columns of a check's name."""


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
