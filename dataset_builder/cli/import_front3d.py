"""The verb `import front3d`: a folder of 3D-FRONT scenes to an index, a report of faults, and the paper's split."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.errors import UserError, printable
from dataset_builder.processes import cores

if TYPE_CHECKING:
    from dataset_builder.importing.front3d_split import SplitProposal
    from dataset_builder.importing.future_models import FutureModel
    from dataset_builder.importing.index_folder import IndexedFile

VERB = "import front3d"
"""Parsed as one word."""
_WORDS = VERB.split()
SEEN = 10
"""Files that are looked into, to see whether a folder holds scenes."""


def one_verb(arguments: Sequence[str]) -> list[str]:
    """The command line with `import front3d` as one word, where that is meant: `import` takes folders, too, and one may
    be called front3d. Where something of that name lies here, scenes of 3D-FRONT must be in a folder that follows."""
    if [*arguments[:2]] != _WORDS or (Path(_WORDS[1]).exists() and not any(map(_holds_scenes, arguments[2:]))):
        return [*arguments]
    return [VERB, *arguments[2:]]


def _holds_scenes(text: str) -> bool:
    """Whether a folder holds a JSON object that begins like a scene of 3D-FRONT."""
    try:
        files = sorted(path for path in Path(text).glob("*.json") if path.is_file())
        return any(b'"uid"' in _beginning(path) for path in files[:SEEN])
    except (OSError, ValueError):
        return False


def _beginning(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(1000)


def add(verbs: common.Verbs) -> None:
    """Add the verb."""
    verb = common.add_verb(verbs, VERB, _import, "index 3D-FRONT scenes, report faults, and propose the paper's split")
    verb.add_argument("folder", type=Path, metavar="DIR", help="folder of the scenes' JSON files")
    verb.add_argument("--models", type=Path, metavar="DIR", help="folder of the 3D-FUTURE models")
    verb.add_argument("--textures", type=Path, metavar="DIR", help="folder of the 3D-FRONT textures")
    verb.add_argument("--model-info", type=Path, metavar="FILE",
                      help="categories of the models (default: model_info.json in their folder)")
    verb.add_argument("--out", type=common.out_folder, default=Path("front3d-specs"), metavar="DIR",
                      help="folder for the index, the report and the specs (default: front3d-specs)")
    verb.add_argument("--index", type=Path, metavar="FILE",
                      help="what was read of scenes, to go on with or to use again (default: index.jsonl in --out)")
    verb.add_argument("--licence", default="", metavar="SPDX",
                      help="licence of scenes and models: LicenseRef-NAME for the terms that you signed")
    verb.add_argument("--workers", type=common.positive, default=cores(), metavar="N",
                      help="processes that read (default: one per core)")
    verb.add_argument("--seed", type=int, default=0, help="which scenes and targets are drawn (default: 0)")
    verb.add_argument("--share", type=_share, default=1.0, metavar="X",
                      help="share of the paper's views per object and scene (default: 1)")
    verb.add_argument("--no-sheet", action="store_true", help="draw no plans of the scenes")


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = 0.0
    if not 0 < share <= 100:
        raise argparse.ArgumentTypeError(f"expected a number above 0, at most 100, got {text}")
    return share


def _import(options: argparse.Namespace) -> int:
    from dataset_builder.importing.front3d_import import SHEET, Front3dJob, import_front3d
    from dataset_builder.report.front3d_report import fault_table, front3d_lines, usable_table
    from dataset_builder.report.progress_bar import with_bar

    console = common.wide_console()
    job = Front3dJob(folder=options.folder, out=options.out, licence=options.licence.strip(), models=options.models,
                     textures=options.textures, model_info=options.model_info, index=options.index,
                     workers=options.workers, seed=options.seed, share=options.share)

    def picture(proposal: "SplitProposal", models: "Mapping[str, FutureModel]", target: Path) -> bool:
        return _sheet(proposal, models, job.folder, target, job.workers)

    took = list[float]()

    def watch(files: "Iterable[IndexedFile]", count: int) -> "Iterator[IndexedFile]":
        start = monotonic()
        yield from with_bar("reading scenes", files, count)
        took.append(monotonic() - start)

    done = import_front3d(job, watch=watch, picture=None if options.no_sheet else picture)
    console.print(usable_table(done))
    if any(scene.faults for scene in done.index.scenes):
        console.print(fault_table(done.index.scenes))
    lines = [*front3d_lines(done, seconds=sum(took), models_named=job.models is not None),
             f"report: {job.out}/scenes.csv, faults.csv, faults/",
             *([f"plans of the scenes: {job.out / SHEET}"] if SHEET in done.files else []),
             *([f"next: dataset-builder plan {done.dataset}"] if done.dataset else [])]
    for line in lines:
        console.print(printable(line), highlight=False, markup=False, soft_wrap=True)
    return 1 if done.dataset is None or any(scene.broken for scene in done.index.scenes) else 0


def _sheet(proposal: "SplitProposal", models: "Mapping[str, FutureModel]", folder: Path, target: Path,
           workers: int) -> bool:
    """Draw the plans; a warning where that fails, since the specs do not need them."""
    from dataset_builder.report.front3d_sheet import write_front3d_sheet

    try:
        write_front3d_sheet(proposal, models, folder, target, workers=workers)
    except (UserError, OSError, ValueError, ArithmeticError, MemoryError) as error:
        print(f"warning: no plans of the scenes ({error})", file=sys.stderr)
        return False
    return True
