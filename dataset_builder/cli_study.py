"""The verb `study`: what accuracy costs in time, and what leaving effects out saves."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataset_builder.studies.sampled import StudySpec

STUDIES = Path("studies")
LAYERS = ("i_t", "s_prime", "i_s")


def add(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb and its two studies."""
    text = "measure what settings cost and bring, on examples of a dataset"
    kinds = verbs.add_parser("study", help=text, description=text).add_subparsers(required=True, metavar="STUDY")
    accuracy = _study(kinds, "accuracy", "error against seconds for every setting, and recommended settings")
    accuracy.add_argument("--examples", type=_positive, default=4, help="examples to measure on (default: 4)")
    accuracy.add_argument("--budget", choices=("full", "small"), default="full",
                          help="small: coarse references and few settings, to see that it works")
    accuracy.add_argument("--layers", nargs="+", default=LAYERS, metavar="LAYER",
                          help=f"layers with light to measure (default: those of {' '.join(LAYERS)} that there are)")
    accuracy.set_defaults(run=_accuracy)
    effects = _study(kinds, "effects", "examples as planned against everything on; exit code 1 where they differ")
    effects.add_argument("--examples", type=_positive, default=6, help="examples to measure on (default: 6)")
    effects.set_defaults(run=_effects)


def _study(kinds: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str) \
        -> argparse.ArgumentParser:
    study = kinds.add_parser(name, help=text, description=text)
    study.add_argument("spec", type=Path, help="dataset spec, a YAML file")
    study.add_argument("--set", action="append", default=[], metavar="A.B=C", dest="overrides",
                       help="override a value of the spec; repeat for more")
    study.add_argument("--out", type=Path, help=f"folder for the results (default: {STUDIES}/NAME-{name})")
    study.add_argument("--backend", choices=("auto", "cuda", "llvm"), default="auto")
    return study


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1, got {text}")
    return int(text)


def _spec(options: argparse.Namespace) -> "StudySpec":
    from dataset_builder.studies.sampled import StudySpec

    return StudySpec(path=options.spec, overrides=tuple(options.overrides))


def _accuracy(options: argparse.Namespace) -> int:
    from dataset_builder.rendering.backend import choose
    from dataset_builder.report.accuracy_page import write_page
    from dataset_builder.studies.accuracy.rows import Row
    from dataset_builder.studies.accuracy.run import AccuracyStudy, conclude, run

    spec, rows = _spec(options), list[Row]()
    study = AccuracyStudy(spec=spec, out=options.out or STUDIES / f"{spec.dataset.name}-accuracy",
                          examples=options.examples, layers=tuple(options.layers), budget=options.budget,
                          backend=options.backend)
    for step in run(study):
        print(f"{step.number}/{step.steps} example {step.example}, {step.group}: {len(step.rows)} rows, "
              + ("kept from an earlier run" if step.kept else f"{step.seconds:.1f} s"), flush=True)
        rows += step.rows
    advice = conclude(study, rows)
    write_page(study, rows, advice, choose(options.backend).summary)
    for question, sentence in advice.sentences.items():
        print(f"{question}: {sentence}")
    print(f"recommended settings, also in {study.out / 'recommended.txt'}:\n{advice.lines()}"
          f"table: {study.table}\nreport: {study.out / 'report.html'}")
    return 0


def _effects(options: argparse.Namespace) -> int:
    from dataset_builder.rendering.backend import choose
    from dataset_builder.report.effects_page import verdict, write_page
    from dataset_builder.studies.effects.run import Compared, EffectsStudy, run
    from dataset_builder.studies.effects.tables import write_tables

    spec, found = _spec(options), list[Compared]()
    study = EffectsStudy(spec=spec, out=options.out or STUDIES / f"{spec.dataset.name}-effects",
                         examples=options.examples, backend=options.backend)
    for compared in run(study):
        found.append(compared)
        wrong = [one.layer for one in compared.differences if not one.holds]
        print(f"example {compared.example}: everything on takes {compared.ratio:.2f} times the time; "
              + (f"beyond the stated error: {', '.join(wrong)}" if wrong else "all layers within the stated error"),
              flush=True)
        write_tables(found, study.out)
    write_page(study, found, choose(options.backend).summary)
    print(f"{verdict(found)}\nreport: {study.out / 'report.html'}")
    return 0 if all(one.holds for compared in found for one in compared.differences) else 1
