"""The command line: parse, call, print. Exit codes: 0 done, 1 a check found something wrong, 2 the user can mend it."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from rich.console import Console

from dataset_builder import __version__
from dataset_builder.cli import evaluate
from dataset_builder.cli import stress
from dataset_builder.cli import study
from dataset_builder.cli import table
from dataset_builder.cli import train
from dataset_builder.cli import validate
from dataset_builder.cli.options import positive
from dataset_builder.engine.local import cores
from dataset_builder.errors import UserError

OUTPUT = Path("datasets")
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit code."""
    options = parser().parse_args(arguments)
    try:
        return options.run(options)
    except UserError as error:
        for problem in error.problems:
            print(f"error: {problem}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted: finished examples and checkpoints are kept; run the same command again to go on",
              file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        return 0


def parser() -> argparse.ArgumentParser:
    """All verbs and their options."""
    root = argparse.ArgumentParser(prog="dataset-builder", description="Build 3DF-Lighting datasets from specs.")
    root.add_argument("--version", action="version", version=__version__)
    verbs = root.add_subparsers(required=True, metavar="VERB")
    _verb(verbs, "doctor", _doctor, "what this machine has, and how to mend what is missing").add_argument(
        "--out", type=Path, default=OUTPUT, help="where datasets will be written")
    plan = _verb(verbs, "plan", _plan, "passes, pixels, paths, time and bytes of a dataset; renders nothing")
    _spec_options(plan)
    plan.add_argument("--example", type=int, action="append", default=[],
                      help="print the whole plan of example N as JSON")
    plan.add_argument("--views", type=positive, default=24, help="views to plan in full; the rest is extrapolated")
    build = _verb(verbs, "build", _build, "build a dataset, or go on with an interrupted build")
    _spec_options(build)
    build.add_argument("--out", type=Path, help=f"output folder (default: {OUTPUT}/NAME)")
    build.add_argument("--workers", type=positive, help="processes (default: one per core, one with a GPU)")
    build.add_argument("--backend", choices=("auto", "cuda", "llvm"), default="auto")
    build.add_argument("--example", type=int, action="append", default=[],
                       help="only stage example N; repeat for more")
    for name, run, text in (("inspect", _inspect, "summary and contact sheet of a dataset"),
                            ("verify", _verify, "check every file, example and identity of a dataset")):
        verb = _verb(verbs, name, run, text)
        verb.add_argument("folder", type=Path)
        if name == "inspect":
            verb.add_argument("--sheet", type=Path, help="where to write the contact sheet (default: in the dataset)")
            verb.add_argument("--rows", type=positive, default=12, help="examples on the contact sheet (default: 12)")
    study.add(verbs)
    table.add(verbs)
    stress.add(verbs)
    train.add(verbs)
    validate.add(verbs)
    evaluate.add(verbs)
    families = _verb(verbs, "families", _families, "embedded furniture and its parameters")
    families.add_argument("family", nargs="?")
    _verb(verbs, "schema", _schema, "write the JSON Schemas of specs").add_argument("folder", type=Path)
    return root


def _verb(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str,
          run: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
    verb = verbs.add_parser(name, help=text, description=text)
    verb.set_defaults(run=run)
    return verb


def _spec_options(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("spec", type=Path, help="dataset spec, a YAML file")
    verb.add_argument("--set", action="append", default=[], metavar="A.B=C", dest="overrides",
                      help="override a value of the spec; repeat for more")


def _doctor(options: argparse.Namespace) -> int:
    from dataset_builder.report.console import finding_table
    from dataset_builder.report.doctor import examine

    findings = examine(options.out)
    Console().print(finding_table(findings))
    return 1 if any(finding.mend for finding in findings) else 0


def _plan(options: argparse.Namespace) -> int:
    from dataset_builder.planning.cost import estimate
    from dataset_builder.planning.plan import Planner, first_plan, plan_example
    from dataset_builder.report.console import decisions_table, estimate_table
    from dataset_builder.spec.load import load_dataset

    loaded = load_dataset(options.spec, options.overrides)
    for index in options.example:
        print(json.dumps(plan_example(loaded, index).model_dump(mode="json"), indent=2))
    if not options.example:
        planner = Planner(loaded)
        Console().print(estimate_table(estimate(planner, views=options.views, cores=cores()), cores()))
        if first := first_plan(planner):
            Console().print(decisions_table(first))
    return 0


def _build(options: argparse.Namespace) -> int:
    from dataset_builder.build import build
    from dataset_builder.engine.unit import Job, Outcome
    from dataset_builder.rendering.backend import choose
    from dataset_builder.report.console import build_table, follow, rejected_lines
    from dataset_builder.report.contact_sheet import write_contact_sheet
    from dataset_builder.spec.load import load_dataset

    console, start = Console(), perf_counter()
    loaded = load_dataset(options.spec, options.overrides)
    chosen = choose(options.backend)
    console.print(f"backend: {chosen.summary}", highlight=False)
    folder = options.out or OUTPUT / loaded.dataset.name
    workers = options.workers or (1 if chosen.variant.startswith("cuda") else cores())
    threads = max(1, cores() // workers)
    job = Job(spec_path=options.spec, overrides=tuple(options.overrides), spec_digest=loaded.spec_digest, folder=folder,
              backend=options.backend, threads=threads)
    outcomes: list[Outcome] = []
    manifest = None
    for event in follow(build(loaded, folder, job, workers=workers, only=options.example), console):
        outcomes += event.outcomes
        manifest = event.manifest or manifest
    rejected = manifest.rejected if manifest else [outcome.rejected for outcome in outcomes if outcome.rejected]
    for line in rejected_lines(rejected):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if not manifest:
        staged, before = len(outcomes) - len(rejected), len(set(options.example)) - len(outcomes)
        console.print(f"{staged} examples staged in {folder}, {before} published before; build without --example to "
                      "finish", highlight=False, soft_wrap=True)
    else:
        console.print(build_table(manifest, outcomes, perf_counter() - start))
        sheet = folder / "previews" / "contact_sheet.png"
        write_contact_sheet(folder, sheet)
        console.print(f"dataset: {folder}\ncontact sheet: {sheet}", highlight=False, soft_wrap=True)
    return 0


def _inspect(options: argparse.Namespace) -> int:
    from dataset_builder.report.contact_sheet import write_contact_sheet
    from dataset_builder.report.dataset_summary import summary_tables

    for table in summary_tables(options.folder):
        Console().print(table)
    sheet = options.sheet or options.folder / "previews" / "contact_sheet.png"
    write_contact_sheet(options.folder, sheet, rows=options.rows)
    print(f"contact sheet: {sheet}")
    return 0


def _verify(options: argparse.Namespace) -> int:
    from dataset_builder.shards.reader import load_manifest
    from dataset_builder.shards.verify import verify

    problems = verify(options.folder)
    for problem in problems:
        print(f"wrong: {problem}")
    if problems:
        print(f"{len(problems)} problem{'s' if len(problems) > 1 else ''}")
        return 1
    totals = load_manifest(options.folder).totals
    print(f"{totals.examples} examples in {totals.shards} shards, {totals.bytes} bytes: all as they should be")
    return 0


def _families(options: argparse.Namespace) -> int:
    from dataset_builder.report.family_tables import family_tables

    for table in family_tables(options.family):
        Console().print(table)
    return 0


def _schema(options: argparse.Namespace) -> int:
    from dataset_builder.files import output_errors
    from dataset_builder.report.schema import schema_files, write_schema

    with output_errors(options.folder):
        write_schema(options.folder)
    for name in schema_files():
        print(options.folder / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
