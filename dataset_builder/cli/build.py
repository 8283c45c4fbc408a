"""The verbs `plan` and `build`: what a dataset costs, and the dataset."""

import argparse
import json
from pathlib import Path
from time import perf_counter

from dataset_builder.api import DATASETS
from dataset_builder.cli.common import Verbs, add_backend, add_cache, add_spec, add_verb, plain_console, positive
from dataset_builder.cli.engine import add_engine, engine_of
from dataset_builder.errors import UserError
from dataset_builder.processes import cores


def add(verbs: Verbs) -> None:
    """Add both verbs."""
    plan = add_verb(verbs, "plan", _plan, "estimate passes, pixels, paths, time and bytes, without rendering")
    add_spec(plan)
    plan.add_argument("--example", type=int, action="append", default=[],
                      help="print the whole plan of example N as JSON")
    plan.add_argument("--views", type=positive, default=24, help="views to plan in full; the rest is extrapolated")
    plan.add_argument("--against", type=Path, metavar="DIR",
                      help="compare with the dataset in DIR: what would run again, and what changed")
    add_cache(plan)
    add_backend(plan)
    build = add_verb(verbs, "build", _build, "build a dataset, or resume an interrupted build")
    add_spec(build)
    build.add_argument("--out", type=Path, help=f"output folder (default: {DATASETS}/NAME)")
    build.add_argument("--replace", action="store_true",
                       help="let the other dataset or major version go that the output folder holds")
    add_cache(build)
    build.add_argument("--workers", type=positive, help="processes (default: one per core, one with a GPU)")
    add_backend(build)
    add_engine(build)
    build.add_argument("--example", type=int, action="append", default=[],
                       help="only stage example N; repeat for more")


def _plan(options: argparse.Namespace) -> int:
    from dataset_builder.engine.against import against
    from dataset_builder.engine.field_tasks import fields_known
    from dataset_builder.engine.unit import BuildJob
    from dataset_builder.planning.cost import estimate
    from dataset_builder.planning.plan import Planner, first_plan, plan_example
    from dataset_builder.planning.precheck import meshes_named
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
        cost = estimate(planner, views=options.views, cores=cores(), known=fields_known(job))
        plain_console().print(estimate_table(cost, cores()))
        if cost.files:
            plain_console().print(files_table(cost.files))
        if first := first_plan(planner):
            plain_console().print(decisions_table(first))
    return 0


def _build(options: argparse.Namespace) -> int:
    from dataset_builder.builder import build
    from dataset_builder.engine.unit import BuildJob, Outcome
    from dataset_builder.report.against_table import runs_line
    from dataset_builder.report.build_progress import Following
    from dataset_builder.report.console import build_table, rejected_lines
    from dataset_builder.spec.load import load_dataset

    console, start = plain_console(), perf_counter()
    loaded = load_dataset(options.spec, options.overrides)
    folder = options.out or DATASETS / loaded.dataset.name
    shown = Following(console)
    outcomes: list[Outcome] = []
    manifest = None
    with engine_of(options, console) as engine:
        news = build(loaded, folder, backend=engine.backend, workers=engine.workers, only=options.example,
                     replace_other=options.replace, cache=options.cache, cache_size=options.cache_size,
                     told=shown.field, run=engine.run, staging_url=engine.staging_url)
        for event in shown.events(news):
            outcomes += event.outcomes
            manifest = event.manifest or manifest
    rejected = manifest.rejected if manifest else [outcome.rejected for outcome in outcomes if outcome.rejected]
    for line in rejected_lines(rejected, folder):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if not manifest:
        staged, before = len(outcomes) - len(rejected), len(set(options.example)) - len(outcomes)
        console.print(f"{staged} examples staged in {folder}, {before} already published; build without --example to "
                      "finish", highlight=False, soft_wrap=True)
    else:
        console.print(build_table(manifest, outcomes, perf_counter() - start))
        job = BuildJob.of(loaded, folder, backend=options.backend, threads=1, cache=options.cache,
                          cache_size=options.cache_size)
        far = options.engine != "local" and not options.cache
        console.print(runs_line(outcomes, None if far else job.store.size()), highlight=False, soft_wrap=True)
        console.print(f"dataset: {folder}\n{_sheet(folder)}", highlight=False, markup=False, soft_wrap=True)
    return 0


def _sheet(folder: Path) -> str:
    """Make the contact sheet of a finished dataset; where it is, or a warning, since the dataset does not need it."""
    from dataset_builder.report.dataset_summary import write_contact_sheet
    from dataset_builder.shards.folder import SHEET

    try:
        write_contact_sheet(folder, folder / SHEET)
    except (UserError, OSError, ValueError, RuntimeError, ArithmeticError, MemoryError) as error:
        return f"warning: no contact sheet ({error})"
    return f"contact sheet: {folder / SHEET}"
