"""A release gate as files: its checks, their values and verdicts, as JSON for programs and Markdown for people."""

import json
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from dataset_builder.files import write_atomic
from dataset_builder.release.dataset_check import Check
from dataset_builder.release.gate import Done, Gate
from dataset_builder.report.estimates import markdown_table
from dataset_builder.report.gate_figures import figures
from dataset_builder.report.gate_lines import figure

JSON, MARKDOWN, FIGURES = "report.json", "report.md", "figures"
CAPTIONS = {
    "light": "Every point is a cell of an object. Left: the light that reaches it and is diffusely reflected, D S', "
             "against I_t. Right: D + R against I_s. Points of a sound dataset lie along the line; a gamma changes "
             "the slope, S' of another example widens the cloud.",
    "mask": "Steepness of I_s under the outline of the mask when the mask is shifted: brightest where most edges are. "
            "The brightest point should be in the middle.",
    "training": "PSNR on the held-out split, example by example: LighTNet against each baseline; above the line it is "
                "better.",
}


@dataclass(frozen=True, kw_only=True)
class Report:
    """What happened. left_out: parts that were asked for and not run."""

    dataset: str
    gate: Gate
    done: tuple[Done, ...]
    left_out: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every check of every part that ran holds."""
        return all(done.holds for done in self.done)

    @property
    def refused(self) -> list[Check]:
        """Checks that failed, in the order they were made."""
        return [check for done in self.done for check in done.found.checks if not check.holds]

    @property
    def verdict(self) -> str:
        """One sentence."""
        ran, seconds = ", ".join(done.part for done in self.done), sum(done.seconds for done in self.done)
        unjudged = sum(not check.judged for done in self.done for check in done.found.checks)
        count = sum(len(done.found.checks) for done in self.done)
        tail = f"{ran}: {count - unjudged} checks judged, {unjudged} not judged, in {seconds:.0f} s"
        return f"passed: {tail}" if self.holds else f"FAILED: {', '.join(check.name for check in self.refused)}; {tail}"


def refusals(report: Report) -> list[str]:
    """A sentence for every check that failed: rule, value, bounds, where the bounds come from."""
    return [f"failed: {check.name}: {check.rule.statement}: expected {check.rule.bounds}, got {_value(check)} "
            f"({check.rule.why})" + (f": {check.detail}" if check.detail else "") for check in report.refused]


def write_report(report: Report) -> None:
    """Write `report.json`, `report.md` and figures of what ran into the gate's folder. Raises OutputError."""
    out = report.gate.out
    made = figures(report.done)
    for name, data in made.items():
        write_atomic(out / FIGURES / f"{name}.png", data)
    write_atomic(out / JSON, (json.dumps(as_data(report), indent=2, allow_nan=False) + "\n").encode())
    write_atomic(out / MARKDOWN, markdown(report, list(made)).encode())


def as_data(report: Report) -> dict[str, Any]:
    """Plain data; a value that is not judged or no number is null, and `verdict` says which."""
    return {
        "dataset": report.dataset, "holds": report.holds, "verdict": report.verdict,
        "not_run": list(report.left_out), "training": report.gate.spec.model_dump(mode="json"),
        "parts": [{"part": done.part, "holds": done.holds, "seconds": round(done.seconds, 2),
                   "problems": list(done.found.problems), "checks": [_check_data(check) for check in done.found.checks]}
                  for done in report.done],
    }


def markdown(report: Report, made: list[str]) -> str:
    """The page."""
    parts = [f"# Release gate of {Path(report.dataset).name}", f"**{report.verdict}.**",
             *([f"Not run, because an earlier part failed: {', '.join(report.left_out)}."] * bool(report.left_out)),
             *(f"- {line}" for line in refusals(report))]
    for done in report.done:
        parts += [f"## {done.part}, {done.seconds:.1f} s", _table(done)]
        if done.found.problems:
            parts.append("\n".join(f"- {problem}" for problem in done.found.problems))
    for name in made:
        parts += [f"![{name}]({FIGURES}/{name}.png)", CAPTIONS[name]]
    return "\n\n".join(parts) + "\n"


def _table(done: Done) -> str:
    rows = [(check.name, check.rule.statement, _value(check), check.rule.bounds, check.verdict, check.rule.why,
             check.detail) for check in done.found.checks]
    head = ("check", "what", "value", "bounds", "holds", "why these bounds", "more")
    return markdown_table(head, rows)


def _value(check: Check) -> str:
    return figure(check.value) if check.value is not None else "not judged"


def _check_data(check: Check) -> dict[str, Any]:
    low, high, value = (None if number is None or not isfinite(number) else number
                        for number in (check.rule.low, check.rule.high, check.value))
    return {"name": check.name, "rule": check.rule.statement, "value": value, "low": low, "high": high,
            "verdict": check.verdict, "why": check.rule.why, "detail": check.detail}
