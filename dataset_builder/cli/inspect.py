"""The verbs that look at a machine, at a finished dataset and at what specs may contain, and the release gate."""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.api import DATASETS
from dataset_builder.cli import common
from dataset_builder.cli.inspect_one import add_one, inspect_one
from dataset_builder.errors import UserError, count_of
from dataset_builder.remote.address import shown, title_of

if TYPE_CHECKING:
    from dataset_builder.release.gate import Gate

PARTS = ("files", "consistency", "loader", "training")


def add(verbs: common.Verbs) -> None:
    """Add `doctor`, `inspect`, `families`, `schema` and `validate`."""
    doctor = common.add_verb(verbs, "doctor", _doctor, "check this machine, and say how to install what is missing")
    doctor.add_argument("--out", type=common.out_folder, default=DATASETS, help="where datasets will be written")
    inspect = common.add_verb(verbs, "inspect", _inspect, "summary and contact sheet of a dataset")
    common.add_dataset(inspect)
    inspect.add_argument("--sheet", type=Path,
                         help="where to write the contact sheet (default: in the dataset; none of one at an address)")
    inspect.add_argument("--rows", type=common.positive, default=12, help="examples on the contact sheet (default: 12)")
    inspect.add_argument("--sequence", metavar="NAME", help="write a strip and an animation of views that follow "
                         "each other, by the name in their labels, and nothing else")
    add_one(inspect)
    _add_gallery(inspect)
    families = common.add_verb(verbs, "families", _families, "embedded furniture and its parameters")
    families.add_argument("family", nargs="?")
    schema = common.add_verb(verbs, "schema", _schema, "write the JSON Schemas of specs")
    schema.add_argument("folder", type=Path)
    text = "release gate: check files and consistency, and train briefly; exit code 1 and the reason on failure"
    verb = common.add_verb(verbs, "validate", _validate, text)
    common.add_dataset(verb)
    verb.add_argument("--only", default=",".join(PARTS), metavar="A,B", help="parts to run (default: %(default)s)")
    verb.add_argument("--all", action="store_true", help="continue after a part that fails")
    verb.add_argument("--examples", type=common.positive, help="examples used by the consistency checks (default: 512)")
    verb.add_argument("--steps", type=common.positive, help="batches to train on")
    common.add_overrides(verb, "the training")
    verb.add_argument("--margin", type=float, help="required lead of LighTNet over each baseline, in dB (default: 0.5)")
    verb.add_argument("--copy-margin", type=float, help="required lead over the copy of I_s, in dB (default: 3)")
    common.add_networks(verb)
    verb.add_argument("--out", type=common.out_folder,
                      help=f"folder for the report (default: {common.STUDIES}/DATASET-validate)")


def _add_gallery(inspect: argparse.ArgumentParser) -> None:
    gallery = inspect.add_argument_group("gallery", "pages to browse the dataset in; nothing else is written then")
    gallery.add_argument("--html", type=common.out_folder, metavar="OUT",
                         help="where to: a name that ends in .html is one file with all inside, another a folder")
    gallery.add_argument("--count", type=common.positive, metavar="N",
                         help="N examples, spread evenly, at least one of each split (default: all)")
    gallery.add_argument("--split", action="extend", nargs="+", default=[], metavar="NAME", dest="splits",
                         help="only these splits")
    gallery.add_argument("--layers", action="extend", nargs="+", default=[], metavar="A,B", help="only these layers")


def _doctor(options: argparse.Namespace) -> int:
    from dataset_builder.report.console import finding_table
    from dataset_builder.report.doctor import examine

    findings = examine(options.out)
    common.plain_console().print(finding_table(findings))
    return 1 if any(finding.mend for finding in findings) else 0


def _inspect(options: argparse.Namespace) -> int:
    from dataset_builder.report.dataset_summary import summary_tables, write_contact_sheet
    from dataset_builder.report.sequence_preview import write_preview

    _require_together(options)
    if options.sequence:
        if isinstance(options.folder, str):
            rule = f"--sequence: expected a folder on this machine, got the address {shown(options.folder)}"
            raise UserError(f"{rule}: its pictures are written there")
        found = write_preview(options.folder, options.sequence)
        print(f"strip: {found.strip}\nanimation of {found.views} views: {found.animation}")
        return 0
    if options.html:
        return _gallery(options)
    if inspect_one(options):
        return 0
    for table in summary_tables(options.folder):
        common.plain_console().print(table)
    if isinstance(options.folder, str) and not options.sheet:
        print("contact sheet: none, say --sheet FILE for one of a dataset at an address")
        return 0
    sheet = options.sheet or options.folder / "previews" / "contact_sheet.png"
    write_contact_sheet(options.folder, sheet, rows=options.rows)
    print(f"contact sheet: {sheet}")
    return 0


def _require_together(options: argparse.Namespace) -> None:
    """Raise UserError where an option would be passed over without a word."""
    if empty := next((name for name in ("example", "mesh", "sequence") if getattr(options, name) == ""), None):
        raise UserError(f"--{empty}: expected a name, got an empty one (leave it away for tables of the dataset)")
    if not options.html:
        given = [name for name, value in (("--count", options.count), ("--split", options.splits),
                                          ("--layers", options.layers)) if value]
        if given:
            raise UserError(f"{given[0]}: expected --html OUT with it, since it chooses what a gallery shows")
    alone = [f"--{name}" for name in ("html", "example", "mesh", "sequence", "sheet") if getattr(options, name)]
    if len(alone) > 1 and alone != ["--example", "--mesh"]:
        raise UserError(f"{alone[0]}: expected no {alone[-1]} with it, since nothing else is written (run it apart)")


def _gallery(options: argparse.Namespace) -> int:
    from dataset_builder.files import size_text
    from dataset_builder.report.gallery.write_gallery import GalleryJob, write_gallery
    from dataset_builder.report.progress_bar import with_bar

    job = GalleryJob(dataset=options.folder, out=options.html, count=options.count,
                     splits=common.names(options.splits), layers=common.names(options.layers))
    done = write_gallery(job, partial(with_bar, "examples"))
    print(f"gallery: {done.page}, {count_of(done.examples, 'example')}, {size_text(done.bytes)}")
    return 0


def _families(options: argparse.Namespace) -> int:
    from dataset_builder.report.spec_help import family_tables

    for table in family_tables(options.family):
        common.plain_console().print(table)
    return 0


def _schema(options: argparse.Namespace) -> int:
    from dataset_builder.files import output_errors
    from dataset_builder.report.spec_help import schema_files, write_schema

    with output_errors(options.folder):
        write_schema(options.folder)
    for name in schema_files():
        print(options.folder / name)
    return 0


def _validate(options: argparse.Namespace) -> int:
    from dataset_builder.files import require_writable
    from dataset_builder.release.gate import Done, LeftOut, run
    from dataset_builder.report.gate_page import Report, lines, refusals, write_report
    from dataset_builder.report.training_lines import follow_training

    console, gate = common.wide_console(), _gate(options)
    require_writable(gate.out)
    done, left_out = list[Done](), tuple[str, ...]()
    for news in follow_training(run(gate), console, lines):
        if isinstance(news, Done):
            done.append(news)
        elif isinstance(news, LeftOut):
            left_out = news.parts
    report = Report(dataset=title_of(options.folder), gate=gate, done=tuple(done), left_out=left_out)
    write_report(report)
    for line in (*refusals(report), report.verdict, f"report: {gate.out / 'report.md'}"):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    return 0 if report.holds else 1


def _gate(options: argparse.Namespace) -> "Gate":
    from dataset_builder.lightnet.settings import load_training
    from dataset_builder.release.consistency import EXAMPLES
    from dataset_builder.release.gate import Gate
    from dataset_builder.release.training_checks import COPY_MARGIN, MARGIN, SETTINGS, STEPS

    parts = tuple(filter(None, options.only.split(",")))
    if not parts or set(parts) - set(PARTS):
        raise UserError(f"--only: expected some of {', '.join(PARTS)}, got {options.only or 'none'}")
    if isinstance(options.folder, str) and "files" in parts:
        rule = "--only: expected no part `files` at an address, whose files are hashed as they are read"
        raise UserError(f"{rule}; say --only {','.join(part for part in PARTS if part != 'files')}")
    spec = load_training(None, [f"steps={options.steps or STEPS}", *SETTINGS, *options.overrides])
    out = options.out or common.STUDIES / f"{common.name_of(options.folder)}-validate"
    return Gate(dataset=options.folder, out=out, spec=spec, parts=parts, device=options.device,
                margin=MARGIN if options.margin is None else options.margin,
                copy_margin=COPY_MARGIN if options.copy_margin is None else options.copy_margin,
                examples=options.examples or EXAMPLES, vgg_weights=options.vgg_weights, stop=not options.all)
