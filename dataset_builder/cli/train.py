"""The verb `train`: LighTNet or a baseline, on the shards of a finished dataset."""

import argparse
from pathlib import Path

from dataset_builder.cli.options import (
    TRAININGS,
    Verbs,
    add_folder,
    add_networks,
    add_overrides,
    add_verb,
    plain_console,
)


def add(verbs: Verbs) -> None:
    """Add the verb."""
    text = "train LighTNet, or a baseline, on a dataset; resumes an earlier run"
    train = add_verb(verbs, "train", _train, text)
    add_folder(train)
    train.add_argument("--config", type=Path, help="how to train, a YAML file (default: LighTNet at its small size)")
    add_overrides(train, "the configuration")
    train.add_argument("--out", type=Path, help=f"folder for checkpoints (default: {TRAININGS}/DATASET-METHOD)")
    add_networks(train)


def _train(options: argparse.Namespace) -> int:
    from dataset_builder.lightnet.settings import load_training
    from dataset_builder.lightnet.training.fit import TrainingJob, fit
    from dataset_builder.report.console import follow_training, lines_of
    from dataset_builder.shards.reader import load_manifest

    spec = load_training(options.config, options.overrides)
    out = options.out or TRAININGS / f"{load_manifest(options.folder).name}-{spec.method}"
    job = TrainingJob(dataset=options.folder, out=out, spec=spec, vgg_weights=options.vgg_weights,
                      device=options.device)
    for _ in follow_training(fit(job), plain_console(), lines_of):
        pass
    return 0
