"""What `import` found: a row of the terminal's table for each model, and a picture of all of them to look at."""

from collections.abc import Iterable, Sequence
from math import ceil
from pathlib import Path

import numpy as np
from PIL import Image
from rich.table import Table

from dataset_builder.api import render_example
from dataset_builder.errors import PlanError, UserError
from dataset_builder.files import write_atomic
from dataset_builder.importing.find_models import PassedOver
from dataset_builder.importing.proposal import Proposal
from dataset_builder.planning.plan import Planner
from dataset_builder.report.console import cell
from dataset_builder.report.example_sheet import PAPER, SheetRow, png_of, sheet
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.usual_sizes import length
from dataset_builder.tonemap import exposure, to_8bit

SIDES = {"from the front": "[10, 60]", "from behind": "[190, 240]"}
"""Range of the camera's azimuth, degrees."""
CAMERA = ("camera.elevation={uniform: [12, 30]}", "camera.coverage=[0.03, 0.25]", "camera.visibility=0.85")
"""Seen whole."""
QUICK = ("image={width: 160, height: 160}", "layers={i_s: frame, mask: object}", "render.spp=32", "render.max_depth=4",
         "rough.sigma=0")
ROWS = 8
"""Models below each other before another column begins."""


def model_table(proposals: Iterable[Proposal]) -> Table:
    """What was written for each model."""
    table = Table("model", "category", "size", "licence", "scale", "up", "said by", title="Models",
                  title_justify="left")
    for each in proposals:
        said = [each.category_from, each.licence.source]
        table.add_row(*map(cell, (each.name, each.category, _size(each), each.licence.spdx,
                                  f"{each.scale:g}", each.up, ", ".join(filter(None, said)))),
                      style="yellow" if each.notes else None)
    return table


def model_lines(proposals: Sequence[Proposal], left_out: Iterable[PassedOver]) -> list[str]:
    """What to look at, what is not honoured of each model, what was mended, and what was left out and why."""
    return [*_shared("look at", ((each.name, note) for each in proposals for note in each.notes)),
            *_shared("not honoured of", ((each.name, each.not_honoured) for each in proposals)),
            *_shared("repaired", ((each.name, each.mended) for each in proposals)),
            *_shared("left out", ((str(one.path), one.reason) for one in left_out))]


def _shared(verb: str, told: Iterable[tuple[str, str]]) -> list[str]:
    """A line for each thing that is told, with the names of all that it is told of."""
    names = dict[str, list[str]]()
    for name, text in told:
        if text:
            names.setdefault(text, []).append(name)
    return [f"{verb} {', '.join(of)}: {text}" for text, of in names.items()]


def write_model_sheet(dataset: Path, proposals: Sequence[Proposal], target: Path, *, backend: str = "auto") -> None:
    """Draw every model of a dataset from two sides, in a room and in the light that its pictures will have.

    A side that no camera sees is left out. Raises OutputError, and UserError where nothing can be rendered.
    """
    sides = {heading: load_dataset(dataset, [*QUICK, *CAMERA, f"camera.azimuth={{uniform: {azimuth}}}"])
             for heading, azimuth in SIDES.items()}
    pictures: dict[str, dict[str, np.ndarray]] = {each.name: {} for each in proposals}
    failed = dict[str, UserError]()
    for heading, loaded in sides.items():
        for name, picture in _pictures(loaded, backend):
            if isinstance(picture, UserError):
                failed[name] = picture
            else:
                pictures[name][heading] = picture
    if failed and not any(pictures.values()):
        raise next(iter(failed.values()))
    rows = [SheetRow(lines=_lines(each, pictures[each.name], each.name in failed), panels=pictures[each.name])
            for each in proposals]
    step = ceil(len(rows) / ceil(len(rows) / ROWS))
    columns = [sheet(rows[start:start + step]) for start in range(0, len(rows), step)]
    page = Image.new("RGB", (sum(column.width for column in columns), max(column.height for column in columns)), PAPER)
    left = 0
    for column in columns:
        page.paste(column, (left, 0))
        left += column.width
    write_atomic(target, png_of(np.asarray(page)))


def _pictures(loaded: LoadedSpec, backend: str) -> Iterable[tuple[str, np.ndarray | UserError]]:
    """One picture of each object that can be planned, or why there is none, with the name of its spec's file."""
    planner, done = Planner(loaded), set[str]()
    sources = {split.name: split.objects.source for split in loaded.dataset.splits}
    for ref in planner.examples:
        name = Path(sources[ref.view.pair.split][ref.view.pair.object]).stem
        if name in done:
            continue
        try:
            plan = planner.example(ref)
        except PlanError:
            continue
        done.add(name)
        try:
            picture = render_example(loaded, plan, backend=backend)["i_s"]
        except UserError as error:
            yield name, error
        else:
            yield name, to_8bit(picture, exposure([picture]))


def _lines(proposal: Proposal, pictures: Iterable[str], failed: bool) -> list[str]:
    """The label of a row."""
    lines = [proposal.name[:30], proposal.category, _size(proposal)]
    if proposal.scale != 1 or proposal.notes:
        lines.append(f"scale {proposal.scale:g}, {proposal.up} up")
    why = "cannot be rendered" if failed else "no camera sees it"
    lines += [f"{why} {heading}" for heading in SIDES if heading not in pictures]
    return [*lines, *("look: see its spec" for _ in proposal.notes[:1])]


def _size(proposal: Proposal) -> str:
    return " x ".join(length(extent) for extent in proposal.size)
