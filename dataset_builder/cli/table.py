"""The verb `table`: the paper's tables on your own dataset, measured rows beside published ones."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.cli import common

if TYPE_CHECKING:
    from dataset_builder.lightnet.settings import TrainingSpec
    from dataset_builder.studies.tables.paper import Table
    from dataset_builder.studies.tables.table_study import RowMeasured, RowNews, TableStudy

KINDS = {
    "methods": "table 1: LighTNet, Pix2Pix, DPR and SSVBRDF, and untrained baselines",
    "objectives": "table 2: LighTNet with the paper's choices of losses",
    "formulations": "table 3: how I_t is composed, and where its shading comes from",
    "weights": "the weights of LighTNet's losses, one changed at a time",
    "noise": "losses that expect noise of the truth: plain, weighted, of two samples",
    "stability": "the table of stability: Pix2Pix and LighTNet on views that follow each other",
}


def add(verbs: common.Verbs) -> None:
    """Add the verb and its tables."""
    text = "train the rows of a table of the paper; print measured and published figures, and if their order agrees"
    kinds = verbs.add_parser("table", help=text, description=text).add_subparsers(required=True, metavar="TABLE")
    for name, what in KINDS.items():
        table = kinds.add_parser(name, help=what, description=what)
        _options(table, name)
        table.set_defaults(run=_table, table=name)
    for name in ("methods", "stability"):
        kinds.choices[name].add_argument("--one-optimiser", action="store_true",
                                         help="train the baselines with LighTNet's optimiser instead of their own")


def _options(table: argparse.ArgumentParser, name: str) -> None:
    common.add_folder(table)
    table.add_argument("--config", type=Path, help="how LighTNet is trained, a YAML file; rows are derived from it")
    common.add_overrides(table, "the configuration")
    table.add_argument("--steps", type=common.positive, help="batches to train every row on; short for --set steps=N")
    table.add_argument("--seeds", type=common.positive, default=1, help="trainings of every row (default: 1)")
    table.add_argument("--out", type=common.out_folder,
                       help=f"folder for the results (default: {common.STUDIES}/DATASET-table-{name})")
    common.add_networks(table)


def _table(options: argparse.Namespace) -> int:
    from dataset_builder.lightnet.data.truth import noise_unknown
    from dataset_builder.report.table_page import cautions, noise_line, order_lines, row_line, write_page
    from dataset_builder.report.training_lines import forecast_line, left_text
    from dataset_builder.shards.reader import load_manifest
    from dataset_builder.studies.tables.result import orders, verdict, write_files
    from dataset_builder.studies.tables.table_study import RowMeasured, TableStudy, jobs_left, results, run
    from dataset_builder.studies.trial_times import TimeLeft, forecast

    base = common.lightnet(options.config, options.overrides, options.steps)
    if options.table == "stability":
        base = _on_sequences(base, options.folder)
    table = _made(options, base)
    out = options.out or common.STUDIES / f"{load_manifest(options.folder).name}-table-{table.name}"
    study = TableStudy(table=table, base=base, dataset=options.folder, out=out, seeds=options.seeds,
                       vgg_weights=options.vgg_weights, device=options.device)
    print(f"{table.number}: {table.question}\n{study.sentence}", flush=True)
    measured: list[RowMeasured] = []
    jobs = jobs_left(study)
    ahead = forecast(jobs)
    print(forecast_line(ahead, sum(job is not None for job in jobs)), flush=True)
    left = TimeLeft(ahead) if ahead else None
    for news in run(study):
        for line in _lines(news):
            print(line + ("" if isinstance(news, RowMeasured) or news.row.spec is None else
                          left_text(left, news.number, news.event, news.row.spec.steps)), flush=True)
        if isinstance(news, RowMeasured):
            measured.append(news)
    found = results(table, measured)
    write_files(table, found, out)
    write_page(study, found)
    for result in found:
        print(row_line(result))
    print(noise_line(found, noise_unknown(load_manifest(options.folder))))
    if order := orders(table, found):
        print("\n".join([*order_lines(order), verdict(order), *cautions(found)]))
    if options.table == "stability":
        for line in _steadiness(study):
            print(line)
    print(f"table: {out / 'table.md'}\nfigure: {out / 'table.png'}")
    return 0


def _on_sequences(base: "TrainingSpec", folder: Path) -> "TrainingSpec":
    """The same, measured on the split that has sequences."""
    from dataset_builder.lightnet.data.lighting_dataset import splits_of
    from dataset_builder.lightnet.results.sequences import sequence_split
    from dataset_builder.studies.trainings import changed

    held_out = sequence_split(folder)
    return changed(base, data={"train": base.data.among(splits_of(folder)).train, "held_out": held_out})


def _steadiness(study: "TableStudy") -> list[str]:
    """Measure the rows on sequences, write the page on them, and what there is to print."""
    from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
    from dataset_builder.lightnet.results.sequences import evaluate_sequences, sequences_of
    from dataset_builder.lightnet.results.spreads import SequenceScores
    from dataset_builder.report.sequence_page import steadiness_lines, write_sequence_page
    from dataset_builder.report.stability_page import deviation_lines, write_stability
    from dataset_builder.studies.tables.table_study import contenders_of

    dataset = LightingDataset(study.dataset, study.base.data.held_out, study.base.data)
    sequences = sequences_of(dataset)
    found = SequenceScores.of(dataset, sequences, evaluate_sequences(contenders_of(study), dataset, sequences))
    write_sequence_page(found, study.out)
    page = write_stability(study, found)
    return [*steadiness_lines(found), *deviation_lines(found), f"stability: {page}"]


def _made(options: argparse.Namespace, base: "TrainingSpec") -> "Table":
    from dataset_builder.studies.tables import table_kinds
    from dataset_builder.studies.tables.table_study import sees_fields

    if options.table == "methods":
        return table_kinds.methods(base, own_optimisers=not options.one_optimiser,
                                   fields=sees_fields(options.folder, base))
    if options.table == "weights":
        return table_kinds.weights(base, vgg=options.vgg_weights is not None)
    if options.table == "stability":
        return table_kinds.stability(base, own_optimisers=not options.one_optimiser)
    return {"objectives": table_kinds.objectives, "formulations": table_kinds.formulations,
            "noise": table_kinds.losses_of_noise}[options.table](base)


def _lines(news: "RowNews | RowMeasured") -> list[str]:
    """What is told while rows are trained: sizes, skipped steps, checks, and when a row is done."""
    from dataset_builder.lightnet.training.events import Finished
    from dataset_builder.report.training_lines import lines_of
    from dataset_builder.studies.tables.table_study import RowMeasured

    head = f"{news.number}/{news.count} {news.row.title}, seed {news.seed}"
    if isinstance(news, RowMeasured):
        how = "kept from an earlier run" if news.kept else "measured"
        return [f"{head}: {len(news.scores)} held-out examples {how}"]
    return [] if isinstance(news.event, Finished) else [f"{head}: {line}" for line in lines_of(news.event)]
