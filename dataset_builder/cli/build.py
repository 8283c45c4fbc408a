"""The verbs `plan` and `build`: what a dataset costs, and the dataset."""

import argparse
import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from dataset_builder.api import DATASETS
from dataset_builder.cli.common import (
    Verbs,
    add_backend,
    add_cache,
    add_spec,
    add_verb,
    example_index,
    local_folder,
    out_folder,
    plain_console,
    positive,
    positive_number,
)
from dataset_builder.cli.engine import add_engine, engine_of
from dataset_builder.cli.watched import add_html, followed
from dataset_builder.errors import UserError, count_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dataset_builder.engine.unit import Outcome
    from dataset_builder.shards.staging import Staging
    from dataset_builder.spec.resolve import LoadedSpec

NO_PICTURE = (UserError, OSError, ValueError, RuntimeError, ArithmeticError, MemoryError)
"""What may go wrong with pictures of what is finished."""


def add(verbs: Verbs) -> None:
    """Add both verbs."""
    plan = add_verb(verbs, "plan", _plan, "estimate passes, pixels, paths, time and bytes, without rendering")
    add_spec(plan)
    plan.add_argument("--example", type=example_index, action="append", default=[],
                      help="print the whole plan of example N as JSON")
    plan.add_argument("--views", type=positive, default=24, help="views to plan in full; the rest is extrapolated")
    plan.add_argument("--workers", type=positive, help="processes that are to share the build (default: as of `build`)")
    plan.add_argument("--speed", type=positive_number, metavar="X",
                      help="of a worker, over the core that rates were measured on (default: 1; on a GPU, of which no "
                           "rate is known, time is predicted only with it)")
    plan.add_argument("--price", type=positive_number, default=0.0, metavar="X", help="of a worker for an hour")
    plan.add_argument("--egress", type=positive_number, default=0.0, metavar="X",
                      help="price of a GB (1e9 bytes) that leaves the place where it was made")
    plan.add_argument("--against", type=local_folder, metavar="DIR",
                      help="compare with the dataset in DIR: what would run again, and what changed")
    add_cache(plan)
    add_backend(plan)
    build = add_verb(verbs, "build", _build, "build a dataset, or resume an interrupted build")
    add_spec(build)
    build.add_argument("--out", type=out_folder, help=f"output folder (default: {DATASETS}/NAME)")
    build.add_argument("--replace", action="store_true",
                       help="replace another dataset or major version in the output folder, or examples that another "
                            "backend made")
    add_cache(build)
    build.add_argument("--workers", type=positive, help="processes (default: one per core, one with a GPU)")
    add_backend(build)
    build.add_argument("--unit-limit", type=_seconds, metavar="SECONDS",
                       help="most that a view may take, 0 for no limit (default: 20 times what is expected, 20 minutes "
                            "at least; none for a single worker, which is this process unless a limit is given)")
    add_engine(build)
    build.add_argument("--example", type=example_index, action="append", default=[],
                       help="only stage example N, and write a page of it; repeat for more")
    build.add_argument("--part", metavar="K/N", help="only stage part K of N, for `merge`")
    add_html(build)
    merge = add_verb(verbs, "merge", _merge, "publish the dataset whose parts `build --part` staged")
    add_spec(merge)
    merge.add_argument("parts", type=local_folder, nargs="+", metavar="DIR", help="folders of all parts, in any order")
    merge.add_argument("--out", type=out_folder, help=f"output folder (default: {DATASETS}/NAME)")
    merge.add_argument("--replace", action="store_true", help="as in `build`")
    add_html(merge)


def _seconds(text: str) -> float:
    """A number of seconds, or 0."""
    try:
        found = float(text)
    except ValueError:
        found = -1.0
    if not 0 <= found < 1e9:
        raise argparse.ArgumentTypeError(f"expected seconds >= 0, got {text}")
    return found


def _plan(options: argparse.Namespace) -> int:
    from dataset_builder.engine.against import against
    from dataset_builder.engine.field_tasks import fields_known
    from dataset_builder.engine.unit import BuildJob
    from dataset_builder.planning.cost import estimate
    from dataset_builder.planning.fleet import Fleet
    from dataset_builder.planning.plan import Planner, first_plan, plan_example
    from dataset_builder.planning.precheck import meshes_named
    from dataset_builder.rendering.backend import default_workers, gpu_usable, on_gpu
    from dataset_builder.rendering.scene.image_check import check_images
    from dataset_builder.report.against_table import against_table
    from dataset_builder.report.console import decisions_table, estimate_table, files_table
    from dataset_builder.spec.load import load_dataset

    loaded = load_dataset(options.spec, options.overrides)
    check_images(loaded)
    planner = Planner(loaded)
    for index in options.example:
        with meshes_named(planner):
            print(json.dumps(plan_example(loaded, index, planner).model_dump(mode="json"), indent=2))
    job = BuildJob.of(loaded, options.against or DATASETS / loaded.dataset.name, backend=options.backend, threads=1,
                      cache=options.cache, cache_size=options.cache_size)
    if options.against:
        plain_console().print(against_table(against(planner, options.against, job)))
    elif not options.example:
        gpu = on_gpu(options.backend)
        if gpu and options.price and not options.speed:
            raise UserError("--price: expected --speed with it on a GPU, of which no rate is known")
        fleet = Fleet(workers=options.workers or default_workers(options.backend), gpu=gpu, speed=options.speed,
                      price=options.price, egress=options.egress)
        known = fields_known(job) if not gpu or gpu_usable() else lambda *_: False
        cost = estimate(planner, views=options.views, cores=fleet.workers, known=known)
        plain_console().print(estimate_table(cost, fleet))
        if cost.files:
            plain_console().print(files_table(cost.files))
        if first := first_plan(planner):
            plain_console().print(decisions_table(first))
    return 0


def _build(options: argparse.Namespace) -> int:
    from dataset_builder.builder import build
    from dataset_builder.engine.dataset_part import DatasetPart
    from dataset_builder.engine.outcomes import Tally
    from dataset_builder.engine.unit import BuildJob, Outcome
    from dataset_builder.report.against_table import runs_line
    from dataset_builder.report.console import build_table, rejected_lines
    from dataset_builder.shards.staging import Staging
    from dataset_builder.spec.load import load_dataset

    console, start = plain_console(), perf_counter()
    part = DatasetPart.parse(options.part) if options.part is not None else None
    loaded = load_dataset(options.spec, options.overrides)
    folder = options.out or DATASETS / (loaded.dataset.name + (f"-part-{part.number}-of-{part.of}" if part else ""))
    tally, manifest, record, single = Tally(), None, None, list[Outcome]()
    with followed(options, loaded, folder, console) as (told, follow), engine_of(options, console) as engine:
        news = build(loaded, folder, backend=engine.backend, workers=engine.workers, only=options.example, part=part,
                     replace_other=options.replace, cache=options.cache, cache_size=options.cache_size,
                     told=told, run=engine.run, staging_url=engine.staging_url, unit_limit=options.unit_limit)
        for event in follow(news):
            tally.add(event.outcomes)
            single += event.outcomes if options.example else ()
            manifest, record = event.manifest or manifest, event.part or record
    rejected = manifest.rejected if manifest else tally.rejected
    for line in rejected_lines(rejected, folder):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if record:
        staged = count_of(len(record.examples), "example")
        console.print(f"part {record.part}: {staged} staged in {folder}, {len(record.rejected)} rejected; give it to "
                      "`merge` with the others", highlight=False, soft_wrap=True)
    elif not manifest:
        staged = count_of(tally.examples - len(rejected), "example")
        before = len(set(options.example)) - tally.examples
        console.print(f"{staged} staged in {folder}, {before} already published; build without "
                      "--example to finish", highlight=False, soft_wrap=True)
        for line in _pages(single, loaded, folder, Staging(folder, engine.staging_url)):
            console.print(line, highlight=False, markup=False, soft_wrap=True)
    else:
        console.print(build_table(manifest, tally, perf_counter() - start))
        job = BuildJob.of(loaded, folder, backend=options.backend, threads=1, cache=options.cache,
                          cache_size=options.cache_size)
        far = options.engine != "local" and not options.cache
        console.print(runs_line(tally, None if far else job.store.size()), highlight=False, soft_wrap=True)
        console.print(f"dataset: {folder}\n{_sheet(folder)}", highlight=False, markup=False, soft_wrap=True)
    return 0


def _merge(options: argparse.Namespace) -> int:
    from dataset_builder.engine.outcomes import Tally
    from dataset_builder.merge import merge
    from dataset_builder.report.console import build_table, rejected_lines
    from dataset_builder.spec.load import load_dataset

    console, start = plain_console(), perf_counter()
    loaded = load_dataset(options.spec, options.overrides)
    folder = options.out or DATASETS / loaded.dataset.name
    with followed(options, loaded, folder, console) as (_, follow):
        news = merge(loaded, options.parts, folder, replace_other=options.replace,
                     said=lambda text: console.print(text, highlight=False, soft_wrap=True))
        manifests = [event.manifest for event in follow(news) if event.manifest]
    for manifest in manifests:
        for line in rejected_lines(manifest.rejected, folder):
            console.print(line, highlight=False, soft_wrap=True)
        console.print(build_table(manifest, Tally(), perf_counter() - start))
        console.print(f"dataset: {folder}\n{_sheet(folder)}", highlight=False, soft_wrap=True)
    return 0


def _pages(outcomes: "list[Outcome]", loaded: "LoadedSpec", folder: Path, staging: "Staging") -> "Iterator[str]":
    """Make the pages of single examples; where they are, or a warning, since the examples do not need them."""
    from dataset_builder.report.staged_example import look_at_outcomes

    try:
        for key, found in look_at_outcomes(outcomes, loaded, folder, staging):
            yield f"page of {key}: {found.page}" + (f", picture: {found.picture}" if found.picture else "")
    except NO_PICTURE as error:
        yield f"warning: no page ({error})"


def _sheet(folder: Path) -> str:
    """Make the contact sheet of a finished dataset; where it is, or a warning, since the dataset does not need it."""
    from dataset_builder.report.dataset_summary import write_contact_sheet
    from dataset_builder.shards.folder import SHEET

    try:
        write_contact_sheet(folder, folder / SHEET)
    except NO_PICTURE as error:
        return f"warning: no contact sheet ({error})"
    return f"contact sheet: {folder / SHEET}"
