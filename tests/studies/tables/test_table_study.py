"""Tables of the paper: its numbers, rows that differ in one thing, and small tables whole."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import OutputError, UserError
from dataset_builder.lightnet.methods.method import TRIVIAL
from dataset_builder.lightnet.settings import TrainingSpec, differences, load_training
from dataset_builder.lightnet.training.fit import TrainingJob, fit
from dataset_builder.studies.tables import paper, table_kinds
from dataset_builder.studies.tables.paper import Table
from dataset_builder.studies.tables.table_study import RowMeasured, TableStudy, results, run, sees_fields
from dataset_builder.studies.trainings import base_of, changed, train
from tests.lightnet.synthetic import PAPER_AND_ROUGH, write_synthetic

TINY = ("model={width: 4, downs: 2}", "data={crop: 32, batch: 2, workers: 0}", "check={every: 2, examples: 2}",
        "steps=2")
BASE = base_of(TrainingSpec())


# The paper's numbers and the rows

def test_the_papers_numbers() -> None:
    assert paper.METHODS["pix2pix"].of("psnr") == 26.65 and paper.METHODS["dpr"].of("ssim") == 0.8692
    assert paper.METHODS["ssvbrdf"].of("lab") == 0.3796 and paper.METHODS["lightnet-dagger"].of("ssim") == 0.9203
    assert paper.OBJECTIVES["l1"].of("ssim") == 0.8774 and paper.OBJECTIVES["fr"].of("lab") == 0.3717
    assert paper.FORMULATIONS["dr-s-plus-alpha"].of("psnr") == 29.45 and paper.SHADINGS["raw"].of("l1") == 0.0260
    full = paper.METHODS["lightnet"]
    assert full == paper.OBJECTIVES["fr-dssim-lab"] == paper.FORMULATIONS["full"] == paper.SHADINGS["full"]
    # Gains that the paper's text names
    assert full.psnr - paper.OBJECTIVES["fr-dssim"].psnr == pytest.approx(0.34)
    assert full.psnr - paper.OBJECTIVES["fr-dssim-lab-l1"].psnr == pytest.approx(0.8)
    assert paper.SHADINGS["direct"].psnr - paper.SHADINGS["raw"].psnr == pytest.approx(0.65)
    assert full.psnr - paper.SHADINGS["raw"].psnr == pytest.approx(1.47)


def changes(table: Table) -> dict[str, set[str]]:
    """Keys in which the specs of a table's rows differ from the reference's."""
    reference = table.row(table.reference).spec
    assert reference is not None
    return {row.name: set(differences(reference, row.spec)) for row in table.rows if row.spec}


def test_formulas_differ_in_the_formula_alone() -> None:
    assert changes(table_kinds.formulations(BASE)) == {
        "full": set(), "d-s": {"model.formulation"}, "dr-s": {"model.formulation"},
        "dr-s-plus-alpha": {"model.formulation"}, "raw": {"model.shading"}, "direct": {"model.shading"}}
    assert len(table_kinds.formulations(BASE).rows) == 6, "the row that both halves share is trained once"


def test_objectives_differ_in_terms_alone() -> None:
    table = table_kinds.objectives(BASE)
    assert changes(table) == {
        "fr-dssim-lab": set(), "fr-dssim": {"objective.lab"}, "fr-dssim-lab-l1": {"objective.l1"},
        "fr": {"objective.dssim", "objective.lab"},
        "l1": {"objective.fr", "objective.dssim", "objective.lab", "objective.l1"}}
    assert {row.spec.objective.dr for row in table.rows if row.spec} == {1.0}
    full = table.row("fr-dssim-lab").spec
    assert full and (full.objective.fr, full.objective.dssim, full.objective.lab) == (0.05, 0.5, 0.5)


def test_weights_are_changed_one_at_a_time() -> None:
    table = table_kinds.weights(BASE, vgg=True)
    found = changes(table)
    assert found.pop("paper") == set() and all(len(keys) == 1 for keys in found.values())
    assert {key for keys in found.values() for key in keys} == {f"objective.{term}" for term in table_kinds.LAMBDAS}
    assert [row.spec.objective.lab for row in table.rows if row.name.startswith("lab-") and row.spec] == [0, 0.1, 2.5]


def test_the_weight_of_a_loss_that_is_off_is_not_swept() -> None:
    table = table_kinds.weights(BASE, vgg=False)
    assert not [row for row in table.rows if row.name.startswith("fr-")] and "FR off: no weights" in table.left_out[-1]
    assert len(table.rows) == 7 and len(table.groups) == 2


def test_methods_differ_in_method_size_and_optimiser() -> None:
    table = table_kinds.methods(BASE)
    for keys in changes(table).values():
        assert keys <= {"method", "model.width", "model.downs", *(f"optimiser.{key}" for key in (
            "rate", "betas", "schedule", "warm_up", "clip"))}
    pix2pix = table.row("pix2pix").spec
    assert pix2pix and (pix2pix.model.width, pix2pix.model.downs) == (64, 7), "128 pixels can be halved seven times"
    assert pix2pix.optimiser.rate == 2e-4 and pix2pix.optimiser.betas == (0.5, 0.999)
    assert {name for name, keys in changes(table_kinds.methods(BASE, own_optimisers=False)).items()
            if any(key.startswith("optimiser") for key in keys)} == set()
    assert {row.name for row in table.rows if row.spec is None} == set(TRIVIAL)


def test_a_dataset_with_fields_has_the_papers_last_row(dataset: Path, tmp_path: Path) -> None:
    """All methods train on rendered I_s, and LighTNet on that of fields beside them."""
    table = table_kinds.methods(BASE, fields=True)
    assert changes(table)["lightnet-dagger"] == {"data.i_s"} and changes(table)["lightnet"] == set()
    assert {row.spec.data.i_s for row in table.rows if row.spec and row.name != "lightnet-dagger"} == {"i_s_clean"}
    assert table.row("lightnet-dagger").printed == paper.METHODS["lightnet-dagger"] and not table.absent
    assert table.groups[0].rows == ("pix2pix", "dpr", "ssvbrdf", "lightnet", "lightnet-dagger")
    both = write_synthetic(tmp_path / "both", train=2, held_out=1, size=16, layers=(*PAPER_AND_ROUGH, "i_s_clean"))
    assert sees_fields(both, BASE) and not sees_fields(dataset, BASE)


def test_baselines_see_whole_crops_and_shrink_below_a_width_of_16() -> None:
    base = base_of(load_training(None, ["model={width: 8, downs: 4}", "data.crop=97"]))
    for row in table_kinds.methods(base).rows:
        if row.spec and row.name != "lightnet":
            assert 96 % 2**row.spec.model.downs == 0
            assert row.spec.model.width == table_kinds.BASELINES[row.name].width // 2


def test_rows_are_trained_to_the_end_whatever_the_configuration_says() -> None:
    assert base_of(changed(TrainingSpec(), check={"patience": 3})).check.patience == 0
    with pytest.raises(UserError, match="expected a configuration of lightnet"):
        base_of(changed(TrainingSpec(), method="dpr"))


# The whole of it

@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_synthetic(tmp_path_factory.mktemp("data") / "set", train=4, held_out=4, size=32)


def tabled(dataset: Path, out: Path, name: str, *options: str) -> int:
    """Exit code of a tiny table."""
    settings = [text for override in TINY for text in ("--set", override)]
    return main(["table", name, str(dataset), "--out", str(out), "--device", "cpu", *settings, *options])


def lines(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_a_table_is_made_and_its_rows_are_kept(dataset: Path, tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    assert tabled(dataset, tmp_path, "methods") == 0
    printed = capsys.readouterr().out
    assert "width 4, 2 steps of 2 examples" in printed and "not the paper's run" in printed
    assert "(paper 30.17)" in printed and "FR off: no weights" in printed
    rows = lines(tmp_path / "table.csv")
    assert [row["row"] for row in rows] == ["pix2pix", "dpr", "ssvbrdf", "lightnet", *TRIVIAL]
    assert {row["examples"] for row in rows} == {"4"} and rows[3]["psnr_paper"] == "30.17"
    assert len(lines(tmp_path / "pairs.csv")) == 24
    page = (tmp_path / "table.md").read_text()
    assert "not the paper's run" in page and "| Pix2Pix |" in page
    assert (tmp_path / "table.png").stat().st_size > 10_000
    # A second run trains nothing and says the same
    assert tabled(dataset, tmp_path, "methods") == 0
    again = capsys.readouterr().out
    assert again.count("kept from an earlier run") == 7 and "step 2" not in again
    assert (tmp_path / "table.md").read_text() == page
    # Other steps are another training: what learns nothing is kept alone
    assert tabled(dataset, tmp_path, "methods", "--steps", "1") == 0
    assert capsys.readouterr().out.count("kept from an earlier run") == 3
    assert [row["steps"] for row in lines(tmp_path / "table.csv")] == ["1"] * 4 + [""] * 3


def test_a_training_that_somebody_is_at_is_not_cleared_away(dataset: Path, tmp_path: Path) -> None:
    job = TrainingJob(dataset=dataset, out=tmp_path / "row", spec=load_training(None, [*TINY, "steps=4"]), device="cpu")
    theirs = fit(job)
    while not (job.out / "last.pt").exists():
        next(theirs)
    with pytest.raises(OutputError, match="another training is running in this folder"):
        next(train(replace(job, spec=changed(job.spec, seed=1))))
    assert (job.out / "last.pt").exists()
    theirs.close()


def test_what_a_later_row_lacks_is_told_before_the_first_is_trained(dataset: Path, tmp_path: Path,
                                                                    capsys: pytest.CaptureFixture[str]) -> None:
    assert tabled(dataset, tmp_path / "out", "noise") == 2
    assert "the dataset has no i_t_se, i_t_half" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_interrupted_row_alone_is_measured_again(dataset: Path, tmp_path: Path) -> None:
    base = base_of(load_training(None, TINY))
    table = table_kinds.objectives(base)
    study = TableStudy(table=replace(table, rows=(table.row("l1"), table.row("fr-dssim")), groups=()), base=base,
                       dataset=dataset, out=tmp_path, seeds=2, device="cpu")
    first = [news for news in run(study) if isinstance(news, RowMeasured)]
    assert [(news.row.name, news.seed, news.kept) for news in first] == [
        ("l1", 0, False), ("l1", 1, False), ("fr-dssim", 0, False), ("fr-dssim", 1, False)]
    assert first[0].scores != first[1].scores, "seeds are seeds"
    (tmp_path / "fr-dssim" / "seed-1" / "scores.csv").unlink()
    again = [news for news in run(study) if isinstance(news, RowMeasured)]
    assert [news.kept for news in again] == [True, True, True, False]
    assert [[row.metrics for row in news.scores] for news in again] == [
        [row.metrics for row in news.scores] for news in first]
    assert [news.facts for news in again] == [news.facts for news in first]
    fresh = results(study.table, again)
    assert [len(result.scores) for result in fresh] == [2, 2] and fresh[0].spread("psnr") > 0
