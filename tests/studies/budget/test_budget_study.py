"""The study of a budget from its spec to its report, at the smallest size; and what an interruption leaves."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.settings import DataSpec, load_training
from dataset_builder.lightnet.training.fit import TrainingJob
from dataset_builder.studies.budget import budget_study
from dataset_builder.studies.budget.budget_study import StudySize
from tests.lightnet.synthetic import write_synthetic
from tests.small_specs import write_spec

TINY = StudySize(grid=(4, 16), budgets=(1, 2), least=2, timed=1, held_out=2, clean=16, seeds=2,
                 training=("model={width: 4, downs: 2}", "data={crop: 16, batch: 2, workers: 0, held_out: test}",
                           "steps=2"))
LAYERS = "layers={i_s: object, i_t: object, d: object, r: object, s_prime: object, mask: object, mask_rough: object}"
SETTINGS = (LAYERS, "render.max_depth=2", "gates={mask_overlap: 0}", "splits.train.lights=1", "rough.sigma=0.004")
ARMS = {"4-x1", "4-x2", "16-x1", "16-x2", "4-target-16-x2", "4-rough-16-x2", "4-source-16-x2", "4-weighted-x2",
        "4-two_samples-x2"}


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The small spec, studied; (spec, out)."""
    spec, out = write_spec(tmp_path_factory.mktemp("budget")), tmp_path_factory.mktemp("out") / "study"
    assert run(spec, out) == 0
    return spec, out


def run(spec: Path, out: Path) -> int:
    """Exit code of the study as a user runs it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(budget_study.SIZES, "small", TINY)
        return main(["study", "budget", str(spec), "--out", str(out), "--budget", "small", "--backend", "llvm",
                     "--workers", "1", "--device", "cpu", "--raw-only",
                     *(text for override in SETTINGS for text in ("--set", override))])


def lines(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_every_arm_is_measured_on_the_same_clean_examples(studied: tuple[Path, Path]) -> None:
    _, out = studied
    assert {line["arm"] for line in lines(out / "arms.csv")} == ARMS
    scores = [lines(path) for path in sorted((out / "scores").glob("*/*/scores.csv"))]
    assert len(scores) == 2 * len(ARMS)
    assert len({tuple((row["key"], row["object"]) for row in rows) for rows in scores}) == 1
    learnt = LightingDataset(out / "datasets" / "4", "train", DataSpec())
    objects = {learnt.label(index).plan.target.object.name for index in range(len(learnt))}
    assert len(objects) == 2 and objects.isdisjoint(row["object"] for row in scores[0])
    assert (out / "report.html").stat().st_size > 50_000 and (out / "figures" / "budget.png").is_file()


def test_passes_that_mixes_share_are_rendered_once(studied: tuple[Path, Path]) -> None:
    """A mix with one pass raised takes all of its passes from the two mixes that have them, as far as those go."""
    _, out = studied
    counts = {line["arm"]: int(line["examples"]) for line in lines(out / "arms.csv")}
    spent = lines(out / "datasets" / "4-target-16" / "seconds.csv")
    target = [line for line in spent if line["step"] == "target"]
    assert len(target) == max(counts["4-target-16-x2"] - counts["16-x2"], 0)
    assert not [line for line in spent if line["step"] in ("rough", "source", "first_hit")]


def test_losses_that_expect_noise_learn_from_what_plain_ones_have(studied: tuple[Path, Path]) -> None:
    _, out = studied
    mixes = {"4", "16", "4-target-16", "4-rough-16", "4-source-16"}
    assert {path.name for path in (out / "datasets").iterdir()} == {*mixes, "held-out"}
    trained = {path.parent.parent.name: json.loads(path.read_text())["objective"]["noise"]
               for path in (out / "trainings").glob("*/*/training.json")}
    others = {"4-weighted-x2": "weighted", "4-two_samples-x2": "two_samples"}
    assert trained == {name: "plain" for name in ARMS} | others


def test_a_second_run_makes_nothing_again(studied: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    spec, out = studied
    before = {path: path.stat().st_mtime_ns for path in [*out.rglob("*.tar"), *out.rglob("last.pt"),
                                                        *out.rglob("scores.csv"), *out.rglob("costs.csv")]}
    table = (out / "arms.csv").read_bytes()
    capsys.readouterr()
    assert run(spec, out) == 0
    assert f"{2 * len(ARMS)} trainings, {2 * len(ARMS)} of them kept" in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in before} == before and (out / "arms.csv").read_bytes() == table


def test_a_training_may_see_some_examples_alone(tmp_path: Path) -> None:
    write_synthetic(tmp_path / "dataset", train=4, held_out=2, size=24)
    keys = LightingDataset(tmp_path / "dataset", "train", DataSpec()).keys
    some = LightingDataset(tmp_path / "dataset", "train", DataSpec(), keys=keys[1:3])
    assert some.keys == keys[1:3] and not some.left_out
    with pytest.raises(UserError, match=r"expected keys of examples in split train, got 99999999"):
        LightingDataset(tmp_path / "dataset", "train", DataSpec(), keys=("99999999",))
    job = TrainingJob(dataset=tmp_path / "dataset", out=tmp_path / "out", spec=load_training())
    assert job.identity() != replace(job, keys=keys[:1]).identity()
    assert job.identity() == replace(job, threads=1).identity()


@pytest.mark.parametrize(("spp", "got"), [("", "nothing"), ("4.5,8", "4.5,8")])
def test_spp_are_whole_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str], spp: str, got: str) -> None:
    assert main(["study", "budget", str(write_spec(tmp_path)), "--spp", spp, "--out", str(tmp_path / "out")]) == 2
    assert f"--spp: expected whole numbers with commas between them, got {got}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
