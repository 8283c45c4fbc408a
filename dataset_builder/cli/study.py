"""The verbs `study` and `stress`: what settings cost and bring, and hard cases, each with a bound that can fail."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from dataset_builder.cli import accuracy_verb, common, study_budget

if TYPE_CHECKING:
    from dataset_builder.studies.noise.noise_study import NoiseStudy
    from dataset_builder.studies.sampled import StudySpec

SIZES = ("small", "full")
LEVELS = "0,0.002,0.004,0.008,0.016"


def add(verbs: common.Verbs) -> None:
    """Add both verbs and the studies."""
    text = "measure the cost and benefit of settings on examples of a dataset"
    kinds = verbs.add_parser("study", help=text, description=text).add_subparsers(required=True, metavar="STUDY")
    accuracy = _study(kinds, "accuracy", accuracy_verb.run,
                      "what an error costs in samples, hours and bytes, with settings for what is asked")
    accuracy_verb.add_options(accuracy)
    effects = _study(kinds, "effects", _effects,
                     "compare examples as planned with all effects simulated; exit code 1 if they differ or that "
                     "is not resolved")
    effects.add_argument("--examples", type=common.positive, default=6, help="examples to measure on (default: 6)")
    noise = _study(kinds, "noise", _noise,
                   "LighTNet at several noise levels of a dataset, trained on all of them and on each")
    _noise_options(noise)
    study_budget.add_options(_study(kinds, "budget", study_budget.run, study_budget.TEXT))
    text = "render hard cases and compare them with known laws and formulas; exit code 1 if one fails"
    verb = common.add_verb(verbs, "stress", _stress, text)
    verb.add_argument("--only", default="", metavar="PATTERN", help="only cases whose name contains or matches PATTERN")
    verb.add_argument("--size", choices=SIZES, default="full", help="small: fewer pixels, samples and faces")
    verb.add_argument("--transport", choices=("camera", "joined"), default="camera",
                      help="joined: cases with a lamp by paths from it joined with the camera's (default: camera)")
    common.add_backend(verb)
    verb.add_argument("--csv", type=Path, metavar="FILE", help="also write the table to this file")
    verb.add_argument("--list", action="store_true", help="print the catalogue as a Markdown table, without running it")


def _study(kinds: common.Verbs, name: str, run: Callable[[argparse.Namespace], int],
           text: str) -> argparse.ArgumentParser:
    study = common.add_verb(kinds, name, run, text)
    common.add_spec(study)
    study.add_argument("--out", type=common.out_folder,
                       help=f"folder for the results (default: {common.STUDIES}/NAME-{name})")
    common.add_backend(study)
    return study


def _noise_options(noise: argparse.ArgumentParser) -> None:
    noise.add_argument("--levels", default=LEVELS, metavar="A,B,..",
                       help="deviations of vertex noise, in bounding radii, rising, or names of levels as in "
                            "smooth,light,medium,heavy,extreme; beside them meshes from fields, as in density or "
                            f"sdf:views=20:resolution=64 (default: {LEVELS})")
    noise.add_argument("--field", action="append", default=[], metavar="KEY=VALUE",
                       help="a key of all these fields, such as size=96; may be repeated")
    noise.add_argument("--alone", choices=("all", "noise"), default="all",
                       help="levels with a training of their own; noise: not those of fields (default: all)")
    noise.add_argument("--x", default="", metavar="FIGURE",
                       help="what curves are drawn over: a figure that labels have of rough meshes, such as "
                       "silhouette_iou (default: roughness_rms; s_relmse with fields)")
    noise.add_argument("--config", type=Path, help="how LighTNet is trained, a YAML file (default: its small size)")
    common.add_overrides(noise, "that configuration", "--train-set", "train_set")
    noise.add_argument("--steps", type=common.positive, help="batches to train on; short for --train-set steps=N")
    noise.add_argument("--per-level-steps", type=common.positive, metavar="N",
                       help="batches of each training on one level (default: as many as on all of them)")
    noise.add_argument("--workers", type=common.positive, help="processes that render (default: one per core)")
    common.add_networks(noise)


def _spec(options: argparse.Namespace) -> "StudySpec":
    from dataset_builder.studies.sampled import StudySpec

    return StudySpec(path=options.spec, overrides=tuple(options.overrides))


def _effects(options: argparse.Namespace) -> int:
    from dataset_builder.rendering.backend import choose
    from dataset_builder.report.effects_page import verdict, write_page
    from dataset_builder.report.step_paces import Paces
    from dataset_builder.studies.effects.effects_study import Compared, EffectsStudy, run, write_tables

    spec, found = _spec(options), list[Compared]()
    study = EffectsStudy(spec=spec, out=options.out or common.STUDIES / f"{spec.dataset.name}-effects",
                         examples=spec.count(options.examples), backend=options.backend)
    print(common.before_study(study.examples, options.examples), flush=True)
    paces, begun = Paces(["both"]), perf_counter()
    for compared in run(study):
        found.append(compared)
        left = paces.after("both", perf_counter() - begun, study.examples - len(found))
        begun = perf_counter()
        said = [f"{name}: {', '.join(own)}" for kind, name in (
            ("differs", "beyond the stated error"), ("not resolved", "not resolved"))
            if (own := [one.layer for one in compared.differences if one.verdict == kind])]
        print(f"example {compared.example}: simulating everything takes {compared.ratio:.2f} times as long; "
              f"{'; '.join(said) or 'all layers within the stated error'}{left}", flush=True)
        write_tables(found, study.out)
    write_page(study, found, choose(options.backend).summary)
    print(f"{verdict(found)}\nreport: {study.out / 'report.html'}")
    return 0 if all(one.verdict == "same" for compared in found for one in compared.differences) else 1


def _noise(options: argparse.Namespace) -> int:
    from dataset_builder.lightnet.training.events import Finished
    from dataset_builder.report.build_progress import Following
    from dataset_builder.report.console import rejected_lines
    from dataset_builder.report.noise_page import NoiseResults, noise_sentence, sentences, write_page
    from dataset_builder.report.training_lines import forecast_line, left_text, lines_of
    from dataset_builder.studies.noise import level_trainings
    from dataset_builder.studies.noise.axes import axis_of
    from dataset_builder.studies.noise.levels import crops, levels_of, write_table
    from dataset_builder.studies.noise.likeness import likenesses, write_likeness
    from dataset_builder.studies.noise.noise_study import count_passes, make, pass_lines, require
    from dataset_builder.studies.trial_times import TimeLeft, forecast, steps_left

    study = _noise_study(options)
    require(study)
    print(study.sentence, flush=True)
    shown = Following(common.plain_console())
    for built in shown.events(make(study, shown.field)):
        for line in rejected_lines(built.manifest.rejected if built.manifest else (), study.dataset):
            print(line)
    passes = count_passes(study)
    print("\n".join(pass_lines(passes)), flush=True)
    jobs = [*level_trainings.jobs(study).values()]
    ahead = forecast(jobs)
    print(forecast_line(ahead, sum(map(bool, map(steps_left, jobs)))), flush=True)
    left = TimeLeft(ahead) if ahead else None
    for news in level_trainings.train_all(study):
        after = left_text(left, news.number, news.event, jobs[news.number - 1].spec.steps)
        for line in () if isinstance(news.event, Finished) else lines_of(news.event):
            print(f"{news.number}/{news.count} {news.name}: {line}{after}", flush=True)
    split = level_trainings.held_out(study)
    levels = levels_of(study, split, level_trainings.measure(study, split))
    write_table(levels, study.out / "levels.csv", axis_of(study.axis))
    if like := likenesses(levels):
        write_likeness(like, study.out / "likeness.csv")
    write_page(NoiseResults(
        study=study, levels=levels, likenesses=like, passes=passes, crops=list(crops(study, split, levels)),
        left_out=split.left_out, rejected=level_trainings.rejected_by_level(study),
        learnt=level_trainings.training_counts(study)))
    print("\n".join([*sentences(levels, like), noise_sentence(study, levels), f"table: {study.out / 'levels.csv'}",
                     f"report: {study.out / 'report.html'}"]))
    return 0


def _noise_study(options: argparse.Namespace) -> "NoiseStudy":
    from dataset_builder.studies.noise.noise_study import NoiseStudy
    from dataset_builder.studies.noise.study_levels import parse_levels

    training = common.lightnet(options.config, options.train_set, options.steps)
    out = options.out or common.STUDIES / f"{_spec(options).dataset.name}-noise"
    return NoiseStudy(spec=options.spec, overrides=tuple(options.overrides), training=training,
                       levels=parse_levels(options.levels, options.field), fields_alone=options.alone == "all",
                       per_level_steps=options.per_level_steps or training.steps, out=out, backend=options.backend,
                       workers=options.workers, vgg_weights=options.vgg_weights, device=options.device, x=options.x)


def _stress(options: argparse.Namespace) -> int:
    from dataset_builder.files import write_atomic
    from dataset_builder.rendering import plugins
    from dataset_builder.rendering.backend import activate
    from dataset_builder.report.console import case_header, show_case
    from dataset_builder.studies.stress.case import SIZES, CaseResult
    from dataset_builder.studies.stress.cases import CASES, markdown, results_table, run_all, select, summary

    cases = select(CASES, options.only)
    if options.list:
        print(markdown(cases), end="")
        return 0
    console, start = common.wide_console(), perf_counter()
    backend = activate(options.backend)
    plugins.register()
    console.print(f"backend: {backend.summary}", highlight=False)
    console.print(case_header())
    results: list[CaseResult] = []
    for result in run_all(cases, replace(SIZES[options.size], transport=options.transport)):
        results.append(result)
        show_case(result, console)
    if options.csv:
        write_atomic(options.csv, results_table(results, size=options.size, backend=backend.variant))
    console.print(summary(results, perf_counter() - start), highlight=False)
    return 0 if all(result.passed for result in results) else 1
