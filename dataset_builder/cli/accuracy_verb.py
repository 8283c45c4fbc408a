"""The options of `study accuracy`, and what it prints."""

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.errors import Problem, UserError

if TYPE_CHECKING:
    from dataset_builder.spec.dataset import DatasetSpec

LAYERS = ("i_t", "s_prime", "i_s")


def add_options(accuracy: argparse.ArgumentParser) -> None:
    """Add what the other studies do not have."""
    accuracy.add_argument("--examples", type=common.positive, default=4, help="examples to measure on (default: 4)")
    accuracy.add_argument("--budget", choices=("full", "medium", "small"), default="full",
                          help="medium: coarser references and fewer settings; small: for a quick trial")
    accuracy.add_argument("--layers", nargs="+", metavar="LAYER",
                          help=f"layers with light to measure (default: those of {' '.join(LAYERS)} in the dataset)")
    accuracy.add_argument("--error", nargs="+", default=[], type=_error, metavar="LAYER=E",
                          help="relative error that 95%% of the examples are to stay below, such as i_t=0.05 "
                               "(default: 0.1 of each layer)")
    accuracy.add_argument("--hours", type=common.positive_number,
                          help="hours that a build may take here: the least errors that they surely buy, in the "
                               "ratios of --error")
    accuracy.add_argument("--count", type=common.positive, metavar="N",
                          help="examples to predict hours and bytes of (default: as many as the spec has)")
    accuracy.add_argument("--within", type=common.positive_number, default=0.1, metavar="SHARE",
                          help="warn where the hours are known less well than this (default: 0.1)")
    accuracy.add_argument("--gpu-speed", type=common.positive_number, metavar="X",
                          help="how many times as fast as a core of this machine a GPU is, where you know")


def _error(text: str) -> tuple[str, float]:
    layer, _, value = text.partition("=")
    if not layer or not value:
        raise argparse.ArgumentTypeError(f"expected LAYER=ERROR such as i_t=0.05, got {text}")
    if not (error := common.positive_number(value)) < 1:
        raise argparse.ArgumentTypeError(f"expected an error below 1, got {text}")
    return layer, error


def _check(dataset: "DatasetSpec", layers: Sequence[str], asked: Sequence[str]) -> None:
    """Raise UserError for layers that were named and cannot be measured, before anything is."""
    from dataset_builder.spec.render import NOISY

    known = [name for name in dataset.layers if name in NOISY]
    rule = f"expected some of {', '.join(known)}, the dataset's layers with light, got "
    problems = [Problem(where="", path=option, rule=rule + name) for option, names in
                (("--layers", layers), ("--error", asked)) for name in dict.fromkeys(names) if name not in known]
    problems += [Problem(where="", path="--error", rule=f"expected one error for each layer, got several for {name}")
                 for name in dict.fromkeys(asked) if asked.count(name) > 1]
    if problems:
        raise UserError(problems)


def run(options: argparse.Namespace) -> int:
    """Measure, conclude, write and print."""
    from dataset_builder.report.accuracy_answers import summary_lines
    from dataset_builder.report.accuracy_page import write_page
    from dataset_builder.report.step_paces import Paces
    from dataset_builder.studies.accuracy.accuracy_study import GROUPS, MEASURES, AccuracyStudy, conclude
    from dataset_builder.studies.accuracy.accuracy_study import run as measured
    from dataset_builder.studies.accuracy.answers import AskedAccuracy
    from dataset_builder.studies.accuracy.rows import OTHERS, AccuracyRow
    from dataset_builder.studies.sampled import StudySpec

    spec, rows = StudySpec(path=options.spec, overrides=tuple(options.overrides)), list[AccuracyRow]()
    errors = dict[str, float](options.error)
    _check(spec.dataset, options.layers or (), [layer for layer, _ in options.error])
    study = AccuracyStudy(spec=spec, out=options.out or common.STUDIES / f"{spec.dataset.name}-accuracy",
                          examples=spec.count(options.examples),
                          layers=tuple(dict.fromkeys((*(options.layers or LAYERS), *errors))),
                          budget=options.budget, backend=options.backend)
    print(common.before_study(study.examples, options.examples), flush=True)
    groups = [group for group in MEASURES if group != GROUPS[OTHERS]]
    paces = Paces(groups)
    for step in measured(study):
        left = "" if step.kept or step.group not in groups else paces.after(
            step.group, step.seconds, study.examples * len(groups) - step.number)
        print(f"{step.number}/{step.steps} example {step.example}, {step.group}: {len(step.rows)} rows, "
              + ("kept from an earlier run" if step.kept else f"{step.seconds:.1f} s{left}"), flush=True)
        rows += step.rows
    found = conclude(study, rows, AskedAccuracy(errors=errors, hours=options.hours, examples=options.count,
                                        within=options.within, gpu_speed=options.gpu_speed))
    write_page(study, found)
    for question, sentence in found.advice.sentences.items():
        print(f"{question}: {sentence}")
    print("\n".join(summary_lines(found)))
    print(f"recommended settings, also in {study.out / 'recommended.txt'}:\n{found.advice.lines()}"
          f"table: {study.table}\nreport: {study.out / 'report.html'}")
    return 0
