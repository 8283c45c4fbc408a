"""The verb `import`: a folder of models to object specs and a dataset."""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.errors import UserError, count_of, printable

if TYPE_CHECKING:
    from dataset_builder.importing.proposal import Proposal


def add(verbs: common.Verbs) -> None:
    """Add the verb."""
    verb = common.add_verb(verbs, "import", _import, "write specs for a folder of models, and a dataset of them")
    verb.add_argument("paths", type=Path, nargs="+", metavar="FILES_OR_FOLDERS",
                      help="model files, or folders to look for them in")
    verb.add_argument("--out", type=common.out_folder, metavar="DIR",
                      help="folder for the specs (default: the first name with -specs, here)")
    verb.add_argument("--licence", default="", metavar="SPDX",
                      help="licence of the models that name none in their files or beside them")
    verb.add_argument("--dataset-licence", default="", metavar="SPDX",
                      help="licence of the dataset, where none follows from its models")
    verb.add_argument("--category", default="", metavar="NAME", help="what all models are (default: from their names)")
    verb.add_argument("--no-sheet", action="store_true", help="render no contact sheet")
    common.add_backend(verb)


def _import(options: argparse.Namespace) -> int:
    from dataset_builder.importing.import_specs import SHEET, ImportJob, import_models
    from dataset_builder.report.model_sheet import model_lines, model_table
    from dataset_builder.report.progress_bar import with_bar

    console = common.wide_console()
    first = options.paths[0].resolve()
    out = options.out or Path(f"{first.name if first.is_dir() else first.stem}-specs")
    job = ImportJob(paths=tuple(options.paths), out=out, licence=options.licence.strip(),
                    dataset_licence=options.dataset_licence.strip(), category=options.category.strip())

    def picture(dataset: Path, proposals: "Sequence[Proposal]", target: Path) -> bool:
        print(f"drawing {len(proposals)} models from two sides", file=sys.stderr, flush=True)
        return _sheet(dataset, proposals, target, options.backend)

    done = import_models(job, ask=input if sys.stdin.isatty() else None, watch=partial(with_bar, "reading models"),
                         picture=None if options.no_sheet else picture)
    proposals = done.proposals
    console.print(model_table(proposals.made))
    unsure = sum(bool(each.notes) for each in proposals.made)
    lines = [*model_lines(proposals.made, proposals.left_out),
             f"{count_of(len(proposals.made), 'model')} written, {count_of(len(proposals.left_out), 'file')} left out, "
             f"{unsure} to look at",
             *([f"contact sheet: {out / SHEET}"] if out / SHEET in done.files else []),
             f"your own camera path and lamps, commented: {done.dataset}; walls: {out / 'rooms' / 'room.yaml'}",
             f"next: dataset-builder view {done.dataset} --example 0, then dataset-builder build {done.dataset}"]
    for line in lines:
        console.print(printable(line), highlight=False, markup=False, soft_wrap=True)
    return 1 if proposals.left_out else 0


def _sheet(dataset: Path, proposals: "Sequence[Proposal]", target: Path, backend: str) -> bool:
    """Draw the contact sheet; a warning where that fails, since the specs do not need it."""
    from dataset_builder.report.model_sheet import write_model_sheet

    try:
        write_model_sheet(dataset, proposals, target, backend=backend)
    except (UserError, OSError, ValueError, RuntimeError, ArithmeticError, MemoryError) as error:
        print(f"warning: no contact sheet ({error})", file=sys.stderr)
        return False
    return True
