"""The verbs that look at a machine, at a finished dataset, and at what specs may contain."""

import argparse
from pathlib import Path

from dataset_builder.api import DATASETS
from dataset_builder.cli.common import Verbs, add_folder, add_verb, plain_console, positive


def add(verbs: Verbs) -> None:
    """Add `doctor`, `inspect`, `verify`, `families` and `schema`."""
    doctor = add_verb(verbs, "doctor", _doctor, "check this machine, and say how to install what is missing")
    doctor.add_argument("--out", type=Path, default=DATASETS, help="where datasets will be written")
    inspect = add_verb(verbs, "inspect", _inspect, "summary and contact sheet of a dataset")
    add_folder(inspect)
    inspect.add_argument("--sheet", type=Path, help="where to write the contact sheet (default: in the dataset)")
    inspect.add_argument("--rows", type=positive, default=12, help="examples on the contact sheet (default: 12)")
    add_folder(add_verb(verbs, "verify", _verify, "check every file, example and identity of a dataset"))
    families = add_verb(verbs, "families", _families, "embedded furniture and its parameters")
    families.add_argument("family", nargs="?")
    schema = add_verb(verbs, "schema", _schema, "write the JSON Schemas of specs")
    schema.add_argument("folder", type=Path)


def _doctor(options: argparse.Namespace) -> int:
    from dataset_builder.report.console import finding_table
    from dataset_builder.report.doctor import examine

    findings = examine(options.out)
    plain_console().print(finding_table(findings))
    return 1 if any(finding.mend for finding in findings) else 0


def _inspect(options: argparse.Namespace) -> int:
    from dataset_builder.report.dataset_summary import summary_tables, write_contact_sheet

    for table in summary_tables(options.folder):
        plain_console().print(table)
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
    print(f"{totals.examples} examples in {totals.shards} shards, {totals.bytes} bytes: no problems found")
    return 0


def _families(options: argparse.Namespace) -> int:
    from dataset_builder.report.spec_help import family_tables

    for table in family_tables(options.family):
        plain_console().print(table)
    return 0


def _schema(options: argparse.Namespace) -> int:
    from dataset_builder.files import output_errors
    from dataset_builder.report.spec_help import schema_files, write_schema

    with output_errors(options.folder):
        write_schema(options.folder)
    for name in schema_files():
        print(options.folder / name)
    return 0
