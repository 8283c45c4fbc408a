"""The verb `stress`: hard cases, each with a bound that can fail."""

import argparse
from pathlib import Path
from time import perf_counter

from dataset_builder.cli.options import Verbs, add_backend, add_verb, wide_console

SIZES = ("small", "full")


def add(verbs: Verbs) -> None:
    """Add the verb."""
    text = "render hard cases and compare them with known laws and formulas; exit code 1 if one fails"
    verb = add_verb(verbs, "stress", _stress, text)
    verb.add_argument("--only", default="", metavar="PATTERN", help="only cases whose name contains or matches PATTERN")
    verb.add_argument("--size", choices=SIZES, default="full", help="small: fewer pixels, samples and faces")
    add_backend(verb)
    verb.add_argument("--csv", type=Path, metavar="FILE", help="also write the table to this file")
    verb.add_argument("--list", action="store_true", help="print the catalogue as a Markdown table, without running it")


def _stress(options: argparse.Namespace) -> int:
    from dataset_builder.files import write_atomic
    from dataset_builder.rendering import plugins
    from dataset_builder.rendering.backend import activate
    from dataset_builder.report.console import case_header, show_case
    from dataset_builder.studies.stress.case import SIZES, CaseResult
    from dataset_builder.studies.stress.cases import CASES, markdown, results_table, run_all, select, summary

    cases = select(CASES, options.only)
    if options.list:
        print(markdown(cases), end="")
        return 0
    console, start = wide_console(), perf_counter()
    backend = activate(options.backend)
    plugins.register()
    console.print(f"backend: {backend.summary}", highlight=False)
    console.print(case_header())
    results: list[CaseResult] = []
    for result in run_all(cases, SIZES[options.size]):
        results.append(result)
        show_case(result, console)
    if options.csv:
        write_atomic(options.csv, results_table(results, size=options.size, backend=backend.variant))
    console.print(summary(results, perf_counter() - start), highlight=False)
    return 0 if all(result.passed for result in results) else 1
