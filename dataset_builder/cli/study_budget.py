"""The study `budget` of the verb `study`: one render budget, many examples with noise or few without."""

import argparse
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.errors import UserError, count_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dataset_builder.studies.budget.arm_trainings import ArmTraining
    from dataset_builder.studies.budget.arms import Arm
    from dataset_builder.studies.budget.budget_study import BudgetStudy

TEXT = ("what to spend render time on: many noisy examples or few clean ones, denoised or raw, samples for which "
        "layers, and whether losses that expect noise pay")


def add_options(verb: argparse.ArgumentParser) -> None:
    """What the study takes beside a spec, a folder and a backend."""
    verb.add_argument("--budget", choices=("full", "small"), default="full",
                      help="small: pictures of 64 pixels, two budgets and a small network, for a trial on two cores")
    verb.add_argument("--spp", metavar="A,B,..", help="samples per pixel to compare, rising (default: 4,16,64,256)")
    verb.add_argument("--held-out", type=common.positive, metavar="N",
                      help="examples to measure on (default: 24 or 96)")
    verb.add_argument("--least", type=common.positive, metavar="N",
                      help="size of the smallest budget: what N examples cost at the largest spp (default: 12 or 48)")
    verb.add_argument("--seeds", type=common.positive, help="trainings of each arm (default: 2 or 3)")
    verb.add_argument("--raw-only", action="store_true", help="without denoised arms, which need pyoidn")
    verb.add_argument("--config", type=Path, help="how LighTNet is trained, a YAML file (default: small ones)")
    common.add_overrides(verb, "that configuration", "--train-set", "train_set")
    verb.add_argument("--steps", type=common.positive, help="batches to train on; short for --train-set steps=N")
    verb.add_argument("--workers", type=common.positive,
                      help="processes that render, or train without a GPU (default: one per core)")
    verb.add_argument("--device", choices=common.DEVICES, default="auto",
                      help="where networks run (default: the GPU, if any)")


def run(options: argparse.Namespace) -> int:
    """Measure costs, build, train, and write what came out."""
    from dataset_builder.rendering.backend import choose
    from dataset_builder.report.budget_page import sentences, write_page
    from dataset_builder.studies.budget.arm_trainings import work_of
    from dataset_builder.studies.budget.arms import arms_of
    from dataset_builder.studies.budget.budget_results import BudgetResults, write_arms
    from dataset_builder.studies.budget.budget_study import require
    from dataset_builder.studies.budget.render_costs import costs_of, measure

    study = _study(options)
    require(study)
    print(study.sentence, flush=True)
    rows = []
    for row in measure(study):
        rows.append(row)
        print(f"example {row.example}, {row.mix}: {row.seconds:.2f} s of the processor, {row.wall_seconds:.2f} s of "
              "the clock", flush=True)
    costs = costs_of(study, rows)
    arms = arms_of({mix: cost.seconds for mix, cost in costs.items()}, study.size.budgets, study.size.least,
                   study.noisy)
    for arm in arms:
        print(f"budget x{arm.budget:g}, {arm.seconds:.0f} s: {arm.title}", flush=True)
    _build(study, arms)
    work = work_of(study, arms)
    _train(study, work)
    found = BudgetResults.of(work)
    write_arms(found, study.out / "arms.csv")
    write_page(study, found, rows, choose(options.backend).summary)
    print("\n".join([*sentences(found), f"table: {study.out / 'arms.csv'}", f"report: {study.out / 'report.html'}"]))
    return 0


def _study(options: argparse.Namespace) -> "BudgetStudy":
    from dataclasses import replace

    from dataset_builder.spec.load import load_dataset
    from dataset_builder.studies.budget.budget_study import SIZES, BudgetStudy

    size = SIZES[options.budget]
    asked = {"least": options.least, "seeds": options.seeds, "held_out": options.held_out,
             "grid": None if options.spp is None else _whole_numbers(options.spp)}
    size = replace(size, **{name: value for name, value in asked.items() if value})
    own = [] if options.config else size.training
    training = common.lightnet(options.config, [*own, *options.train_set], options.steps)
    name = load_dataset(options.spec, options.overrides).dataset.name
    return BudgetStudy(spec=options.spec, overrides=tuple(options.overrides), size=size, training=training,
                       out=options.out or common.STUDIES / f"{name}-budget", backend=options.backend,
                       workers=options.workers, device=options.device, denoise=not options.raw_only)


def _whole_numbers(text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise UserError(f"--spp: expected whole numbers with commas between them, got {text or 'nothing'}") from error


def _build(study: "BudgetStudy", arms: "Sequence[Arm]") -> None:
    from itertools import groupby

    from dataset_builder.report.build_progress import Following
    from dataset_builder.report.console import rejected_lines
    from dataset_builder.studies.budget.arm_trainings import build_all

    for name, news in groupby(build_all(study, arms), key=lambda named: named[0]):
        print(f"dataset {name}", flush=True)
        shown = Following(common.plain_console())
        for built in shown.events(event for _, event in news):
            for line in rejected_lines(built.manifest.rejected if built.manifest else (), study.out / name):
                print(line)


def _train(study: "BudgetStudy", work: "Sequence[ArmTraining]") -> None:
    from statistics import fmean

    from dataset_builder.report.console import duration
    from dataset_builder.studies.budget.arm_trainings import train_all

    count, kept, begun = len(work), sum(bool(one.kept()) for one in work), perf_counter()
    print(f"{count_of(count, 'training')}, {kept} of them kept from an earlier run", flush=True)
    for number, one in enumerate(train_all(study, work), start=1):
        psnr = fmean(row.metrics.psnr for row in one.kept())
        pace = (perf_counter() - begun) / max(number - kept, 1)
        left = f"; about {duration(pace * (count - number))} left" if kept < number < count else ""
        print(f"{number}/{count} x{one.arm.budget:g}, {one}: {psnr:.2f} dB{left}", flush=True)
