"""Noise of the truth on its way: from a dataset's layers to batches, rows, files and pages."""

import csv
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.label.example_label import Denoised
from dataset_builder.lightnet.data import loader
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset, measured
from dataset_builder.lightnet.data.truth import noise_layers, noise_unknown
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.evaluate import evaluate, trivial
from dataset_builder.lightnet.settings import DataSpec, ObjectiveSpec, TrainingSpec
from dataset_builder.lightnet.training.fit import TrainingJob, fit
from dataset_builder.release.training_checks import compare
from dataset_builder.report.table_page import markdown, noise_line, row_line
from dataset_builder.shards.reader import load_manifest
from dataset_builder.studies.tables import table_kinds
from dataset_builder.studies.tables.result import RowResult
from dataset_builder.studies.trainings import read_scores, write_scores
from tests.lightnet.formula_method import write_checkpoint
from tests.lightnet.synthetic import PAPER_AND_ROUGH, write_synthetic

EXTRA = ("i_t_se", "i_t_half")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with standard errors of a tenth, and halves that are a tenth less; not to be changed."""
    return write_synthetic(tmp_path_factory.mktemp("noise") / "synthetic", train=2, held_out=3, size=40,
                           layers=(*PAPER_AND_ROUGH, *EXTRA))


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without them."""
    return write_synthetic(tmp_path_factory.mktemp("bare") / "synthetic", train=2, held_out=2, size=40)


def test_batches_hold_what_was_asked_for_exposed_as_the_truth(folder: Path) -> None:
    spec = TrainingSpec(data=DataSpec(batch=2, crop=32, workers=0))
    data = LightingDataset(folder, "train", spec.data, extra=EXTRA)
    batch = next(loader.training_batches(data, spec, multiple=8))
    assert batch.truth.i_t_se is not None and batch.truth.i_t_half is not None
    for layer, share in ((batch.truth.i_t_se, 0.1), (batch.truth.i_t_half, 0.9)):
        np.testing.assert_allclose(layer.numpy(), share * batch.truth.i_t.numpy(), rtol=1e-5)
    plain = next(loader.training_batches(LightingDataset(folder, "train", spec.data), spec, multiple=8))
    assert plain.truth.i_t_se is None and np.array_equal(plain.truth.i_t.numpy(), batch.truth.i_t.numpy())


def test_rows_know_what_the_noise_does_to_them(folder: Path, bare: Path, tmp_path: Path) -> None:
    rows = list(evaluate(trivial(), measured(folder, "evaluation", DataSpec()), range(3)))
    for row in rows:
        assert row.noise_known and row.ceiling.psnr > row.metrics.psnr and row.corrected.psnr >= row.metrics.psnr
        assert row.ceiling == next(one.ceiling for one in rows if one.key == row.key)
    write_scores(rows, tmp_path / "scores.csv")
    assert read_scores(tmp_path / "scores.csv") == tuple(rows)
    assert not any(row.noise_known for row in evaluate(trivial(), measured(bare, "evaluation", DataSpec()), range(2)))


def test_errors_of_a_denoised_truth_are_not_its_own(folder: Path, bare: Path) -> None:
    manifest = load_manifest(folder)
    assert noise_layers(manifest) == ("i_t_se",) and noise_unknown(manifest) == ""
    assert "storage.standard_errors=true" in noise_unknown(load_manifest(bare))
    record = Denoised.model_construct(layer="i_t")
    assert "denoised" in noise_unknown(manifest.model_copy(update={"denoised": (record,)}))


def test_the_verb_prints_and_writes_them(folder: Path, bare: Path, tmp_path: Path,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    checkpoint = str(write_checkpoint(tmp_path / "best.pt"))
    assert main(["evaluate", str(folder), "--checkpoint", checkpoint, "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "noise ceiling" in printed and "without noise" in printed
    with (tmp_path / "out" / "table.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    assert all(float(line[f"{metric.name}{end}"]) >= 0 for line in lines for metric in METRICS
               for end in ("_ceiling", "_corrected"))
    text = (tmp_path / "out" / "summary.md").read_text()
    assert "## Noise of the truth" in text and "| PSNR, dB (high is better) |" in text
    assert main(["evaluate", str(bare), "--checkpoint", checkpoint, "--out", str(tmp_path / "bare")]) == 0
    assert "Noise ceiling unknown: the dataset has no i_t_se" in " ".join(capsys.readouterr().out.split())
    assert "nan" not in (tmp_path / "bare" / "summary.md").read_text()


def test_tables_and_the_gate_have_them(folder: Path) -> None:
    rows = list(evaluate(trivial(), measured(folder, "evaluation", DataSpec()), range(3)))
    table = table_kinds.methods(TrainingSpec())
    results = [RowResult(row=table.row(name), scores=(tuple(row for row in rows if row.method == name),), facts={})
               for name in table_kinds.TRIVIAL]
    assert "without noise)" in row_line(results[0]) and noise_line(results, "").startswith("noise ceiling: L1 ")
    reference = RowResult(row=table.row("lightnet"), scores=results[0].scores, facts={})
    text = markdown(table, [reference, *results], "settings")
    assert "*noise ceiling*" in text and "I_s as it is, without noise" in text
    ceiling, beats, *_ = compare(rows, "copy_i_s", margin=0, copy_margin=0)
    assert ceiling.name == "noise_ceiling" and ceiling.judged and "without noise)" in beats.detail


def test_a_training_that_needs_what_is_not_there_is_refused(bare: Path, tmp_path: Path) -> None:
    for noise, hint in (("weighted", "storage.standard_errors=true"), ("two_samples", "i_t_half among its layers")):
        spec = TrainingSpec(objective=ObjectiveSpec(noise=noise))
        with pytest.raises(UserError, match=hint):
            next(fit(TrainingJob(dataset=bare, out=tmp_path / noise, spec=spec)))
