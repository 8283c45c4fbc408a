"""The verb `train`: LighTNet or a baseline, on the shards of a finished dataset."""

import argparse
from pathlib import Path

from dataset_builder.cli.options import DEVICES

TRAININGS = Path("trainings")


def add(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    text = "train LighTNet, or a baseline, on a dataset; goes on where an earlier run stopped"
    train = verbs.add_parser("train", help=text, description=text)
    train.add_argument("folder", type=Path, help="finished dataset")
    train.add_argument("--config", type=Path, help="how to train, a YAML file (default: LighTNet at its small size)")
    train.add_argument("--set", action="append", default=[], metavar="A.B=C", dest="overrides",
                       help="override a value of the configuration; repeat for more")
    train.add_argument("--out", type=Path, help=f"folder for checkpoints (default: {TRAININGS}/DATASET-METHOD)")
    train.add_argument("--vgg-weights", type=Path, metavar="FILE",
                       help="VGG-19 trained on ImageNet, for the feature reconstruction loss; off without it")
    train.add_argument("--device", choices=DEVICES, default="auto")
    train.set_defaults(run=_train)


def _train(options: argparse.Namespace) -> int:
    from rich.console import Console

    from dataset_builder.lightnet.settings import load_training
    from dataset_builder.lightnet.training.fit import Job, fit
    from dataset_builder.report.training import follow
    from dataset_builder.shards.reader import load_manifest

    spec = load_training(options.config, options.overrides)
    out = options.out or TRAININGS / f"{load_manifest(options.folder).name}-{spec.method}"
    job = Job(dataset=options.folder, out=out, spec=spec, vgg_weights=options.vgg_weights, device=options.device)
    for _ in follow(fit(job), Console()):
        pass
    return 0
