"""The verbs `train`, `evaluate` and `compose`: networks on the shards of a dataset, and what they make of objects."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.errors import UserError

if TYPE_CHECKING:
    from dataset_builder.lightnet.results.compose_input import ComposeInput
    from dataset_builder.lightnet.settings import DataSpec

FILES = {"i_s": "--i-s", "s_prime": "--s-prime", "mask": "--mask"}
SCENES = {"background": "--background", "empty": "--empty"}
OPTIONS = {**FILES, **SCENES, "mask_rough": "--mask-rough"}
HELP = {"i_s": "the object under plain light, I_s", "s_prime": "raw lighting of its rough mesh in the scene, S'",
        "mask": "share of each pixel that the object covers, M", "background": "frame of the whole scene, I_PBR",
        "empty": "frame of the scene without the object, under the same light",
        "mask_rough": "mask of the rough mesh, to find where S' does not show the object"}


def add(verbs: common.Verbs) -> None:
    """Add the three verbs."""
    text = "train LighTNet, or a baseline, on a dataset; resumes an earlier run"
    train = common.add_verb(verbs, "train", _train, text)
    common.add_dataset(train)
    train.add_argument("--config", type=Path, help="how to train, a YAML file (default: LighTNet at its small size)")
    common.add_overrides(train, "the configuration")
    train.add_argument("--out", type=common.out_folder,
                       help=f"folder for checkpoints (default: {common.TRAININGS}/DATASET-METHOD)")
    common.add_networks(train)
    text = "measure checkpoints on held-out examples and compare them with three untrained baselines"
    verb = common.add_verb(verbs, "evaluate", _evaluate, text)
    common.add_dataset(verb)
    verb.add_argument("--checkpoint", type=Path, action="append", required=True, help="repeat to compare several")
    verb.add_argument("--split", help="split to measure on (default: the one held out, or one not trained on)")
    verb.add_argument("--examples", type=common.positive, help="spread evenly over the split (default: all)")
    verb.add_argument("--sequence", action="store_true", help="measure views that follow each other: their deviations, "
                      "and the flicker between neighbours")
    verb.add_argument("--out", type=common.out_folder,
                      help="folder for the results (default: evaluation, beside the checkpoint)")
    common.add_networks(verb, trains=False)
    text = "put a predicted object back into a frame of its scene, for an example of a dataset or your own EXR files"
    verb = common.add_verb(verbs, "compose", _compose, text)
    verb.add_argument("folder", type=common.local_folder, nargs="?",
                      help="finished dataset; omit it if files are given")
    verb.add_argument("--checkpoint", type=Path, required=True)
    verb.add_argument("--example", default="", metavar="KEY", help="example to compose, by its key")
    verb.add_argument("--index", type=int, default=0, help="or by its index in the split (default: the first)")
    verb.add_argument("--split", help="split that --index refers to (default: as of evaluate)")
    for name, option in OPTIONS.items():
        verb.add_argument(option, type=Path, metavar="FILE", dest=name, help=HELP[name])
    verb.add_argument("--no-shadow", action="store_true", help="put it into the scene without the object, as it is")
    verb.add_argument("--out", type=common.out_folder,
                      help="folder for the results (default: composite, beside the checkpoint)")
    common.add_networks(verb, trains=False)


def _train(options: argparse.Namespace) -> int:
    from dataset_builder.lightnet.settings import load_training
    from dataset_builder.lightnet.training.fit import TrainingJob, fit
    from dataset_builder.report.training_lines import follow_training, lines_of
    from dataset_builder.shards.reader import load_manifest

    spec = load_training(options.config, options.overrides)
    out = options.out or common.TRAININGS / f"{load_manifest(options.folder).name}-{spec.method}"
    job = TrainingJob(dataset=options.folder, out=out, spec=spec, vgg_weights=options.vgg_weights,
                      device=options.device)
    for _ in follow_training(fit(job), common.plain_console(), lines_of):
        pass
    return 0


def _evaluate(options: argparse.Namespace) -> int:
    from rich.progress import track

    from dataset_builder.files import require_writable
    from dataset_builder.lightnet.data.lighting_dataset import measured, splits_of
    from dataset_builder.lightnet.data.truth import noise_unknown
    from dataset_builder.lightnet.results import sequences as steps
    from dataset_builder.lightnet.results.evaluate import ScoreRow, contender, evaluate, load_all, trivial
    from dataset_builder.lightnet.results.spreads import SequenceScores
    from dataset_builder.report import evaluation_page as page
    from dataset_builder.report.example_sheet import write_sheet
    from dataset_builder.report.sequence_page import steadiness_lines, write_sequence_page
    from dataset_builder.shards.reader import load_manifest
    from dataset_builder.spread import spread_indices

    if options.sequence and options.examples:
        raise UserError(f"--examples: expected none beside --sequence, which needs every view, got {options.examples}")
    console, loaded = common.wide_console(), load_all(options.checkpoint, options.device)
    data = next(iter(loaded.values())).spec.data
    split = options.split or (steps.sequence_split(options.folder) if options.sequence else
                              data.measured(splits_of(options.folder)))
    dataset = measured(options.folder, split, data)
    sequences = steps.sequences_of(dataset) if options.sequence else []
    out = options.out or options.checkpoint[0].parent / "evaluation"
    require_writable(out)
    indices = spread_indices(len(dataset), options.examples or 0)
    trained = [contender(name, one) for name, one in loaded.items()]
    contenders = [*trained, *trivial()]
    found = list(track(
        steps.evaluate_sequences(contenders, dataset, sequences) if options.sequence else
        evaluate(contenders, dataset, indices), console=console, description="predictions",
        total=len(indices) * len(contenders) + sum(one.neighbours for one in sequences) * (len(contenders) + 1)))
    rows = [row for row in found if isinstance(row, ScoreRow)]
    here = (dataset.name, dataset.split)
    evaluation = page.Evaluation(
        dataset=dataset.name, split=dataset.split, rows=rows, notes={one.name: one.note for one in contenders},
        trained=tuple(loaded), remarks=dataset.notes, noise_unknown=noise_unknown(load_manifest(options.folder)),
        seen=any((one.dataset, one.spec.data.train) == here for one in loaded.values()))
    page.write_page(evaluation, out)
    write_sheet(page.example_rows(rows, trained, dataset), out / page.EXAMPLES)
    console.print(page.console_table(evaluation))
    lines = page.verdict_lines(evaluation)
    if options.sequence:
        steady = SequenceScores.of(dataset, sequences, found)
        write_sequence_page(steady, out)
        lines += steadiness_lines(steady)
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)
    console.print(f"results: {out}", highlight=False, soft_wrap=True)
    return 0


def _compose(options: argparse.Namespace) -> int:
    from dataset_builder.lightnet.methods.checkpoint import load_trained
    from dataset_builder.lightnet.results.compose import compose, panels
    from dataset_builder.report.example_sheet import write_composite

    trained = load_trained(options.checkpoint, options.device)
    frame = _frame(options, trained.spec.data)
    composite = compose(trained, frame, shadow=not options.no_shadow)
    out = options.out or options.checkpoint.parent / "composite"
    files = write_composite(composite, panels(frame, composite), out, title=frame.name)
    print(f"{frame.name}: {composite.predicted.sum()} pixels predicted, {composite.filled.sum()} filled at the rim")
    for file in files:
        print(file)
    return 0


def _frame(options: argparse.Namespace, data: "DataSpec") -> "ComposeInput":
    """The example, or the files; not a mixture."""
    from dataset_builder.lightnet.data.lighting_dataset import splits_of
    from dataset_builder.lightnet.results.compose_input import input_from_dataset, input_from_files

    files = {name: path for name in OPTIONS if (path := getattr(options, name))}
    if options.folder:
        if files:
            raise UserError("expected a dataset or files, got both")
        split = options.split or data.measured(splits_of(options.folder))
        return input_from_dataset(options.folder, key=options.example, split=split, index=options.index)
    scenes = " or ".join(SCENES.values())
    missing = [option for name, option in FILES.items() if name not in files]
    missing += [] if files.keys() & SCENES.keys() else [scenes]
    if missing:
        raise UserError(f"expected a dataset, or files of {', '.join(FILES.values())} and {scenes}: "
                        f"{', '.join(missing)} missing")
    return input_from_files(files)
