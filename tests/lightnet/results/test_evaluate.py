"""Rows are what the metrics say of predictions on whole frames; the verb writes them, and names what is wrong."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.batch import Prediction
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.ranges import tone_map
from dataset_builder.lightnet.measures.metrics import METRICS, Metrics, measure
from dataset_builder.lightnet.methods.method import TRIVIAL, predict
from dataset_builder.lightnet.results.evaluate import Contender, contender, evaluate, load_all, trivial
from dataset_builder.lightnet.results.pictures import GAIN, cropped, difference, found, given, light, signed, square
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.report.evaluation_page import example_rows
from dataset_builder.shards import exr
from dataset_builder.shards.reader import open_dataset
from tests.lightnet.formula_method import product, trained, write_checkpoint
from tests.lightnet.synthetic import write_synthetic

EXAMPLES = 5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset; not to be changed."""
    return write_synthetic(tmp_path_factory.mktemp("evaluate") / "synthetic", train=2, held_out=EXAMPLES, size=40)


@pytest.fixture(scope="module")
def dataset(folder: Path) -> LightingDataset:
    """Its held-out split."""
    return LightingDataset(folder, "evaluation", DataSpec())


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained LighTNet."""
    return write_checkpoint(tmp_path_factory.mktemp("small") / "best.pt")


def told_the_truth() -> Contender:
    """Cannot be beaten."""
    return Contender(name="truth", find=lambda batch: Prediction(i_t=batch.truth.i_t))


def test_rows_say_what_the_metrics_say(dataset: LightingDataset) -> None:
    net = trained(product)
    rows = list(evaluate([contender("net", net), *trivial()], dataset, [3, 1]))
    assert [(row.key, row.method) for row in rows] == [(dataset.keys[index], name) for index in (3, 1)
                                                       for name in ("net", *TRIVIAL)]
    for index, own in ((3, rows[:4]), (1, rows[4:])):
        batch = dataset[index]
        expected = [predict(net.method, batch.inputs).i_t, *(formula(batch) for formula in TRIVIAL.values())]
        for row, i_t in zip(own, expected, strict=True):
            assert [row.metrics] == measure(i_t, batch.truth.i_t, batch.inputs.inside)
            plan = dataset.label(index).plan
            assert (row.view, row.object, row.room) == (plan.view, plan.target.object.name, plan.room.name)
            assert (row.level, row.sigma) == (plan.rough.level, plan.rough.sigma) and row.seconds > 0


def test_the_truth_is_perfect_and_formulas_are_not(dataset: LightingDataset) -> None:
    rows = list(evaluate([told_the_truth(), *trivial()], dataset, range(EXAMPLES)))
    for row in rows:
        perfect = row.metrics == Metrics(l1=0.0, psnr=100.0, ssim=1.0, lab=0.0)
        assert perfect == (row.method == "truth")


def test_an_untrained_checkpoint_is_read_and_measured(checkpoint: Path, dataset: LightingDataset) -> None:
    loaded = load_all([checkpoint], "cpu")
    (name, net), = loaded.items()
    row, = evaluate([contender(name, net)], dataset, [0])
    assert name == "lightnet" == row.method and 5 < row.metrics.psnr < 100
    assert contender(name, net).note.endswith(" parameters, 3 steps on elsewhere; fr is off")


def test_names_of_checkpoints_differ(tmp_path: Path) -> None:
    places = ("one/best.pt", "two/best.pt", "two/last.pt", "other/one/best.pt")
    paths = [write_checkpoint(tmp_path / place) for place in places]
    assert list(load_all(paths[:1], "cpu")) == ["lightnet"]
    assert list(load_all(paths[:2], "cpu")) == ["lightnet one", "lightnet two"]
    assert list(load_all(paths[:3], "cpu")) == ["lightnet one", "lightnet two best.pt", "lightnet two last.pt"]
    assert list(load_all([paths[0], paths[3]], "cpu")) == [str(paths[0]), str(paths[3])]
    assert list(load_all([paths[0], paths[0]], "cpu")) == ["lightnet"]
    other = write_checkpoint(tmp_path / "dpr" / "best.pt", method="dpr")
    assert list(load_all([paths[0], other], "cpu")) == ["lightnet", "dpr"]


def test_methods_of_other_pixels_are_not_compared(tmp_path: Path, checkpoint: Path) -> None:
    other = write_checkpoint(tmp_path / "best.pt", inside=0.25)
    with pytest.raises(UserError, match=r"data.inside: expected 0.5, as the first checkpoint .* got 0.25"):
        load_all([checkpoint, other], "cpu")


def test_pictures_are_mapped_as_metrics_are(dataset: LightingDataset) -> None:
    batch = dataset[2]
    prediction = Prediction(i_t=batch.truth.i_t * 1.5)
    shown = {**given(batch), **found(batch, prediction)}
    assert list(shown) == ["I_s", "S'", "prediction", "truth", f"|difference| x {GAIN}"]
    display = tone_map(batch.truth.i_t[0]).permute(1, 2, 0).numpy()
    assert np.abs(shown["truth"] / 255 - display).max() <= 0.5 / 255 + 1e-6
    inside = batch.inputs.inside[0, 0].numpy() > 0
    l1 = shown[f"|difference| x {GAIN}"][inside].mean() / 255 / GAIN
    measured, = measure(prediction.i_t, batch.truth.i_t, batch.inputs.inside)
    assert l1 == pytest.approx(measured.l1, abs=0.5 / 255 / GAIN)
    assert not shown["truth"][~inside].any()


def test_values_of_either_sign_are_shown_about_grey() -> None:
    values = torch.tensor([-2.0, -1.0, 0.0, 0.5, 1.0, 3.0]).expand(3, 1, 6)
    assert signed(values)[0, :, 0].tolist() == [0, 0, 128, 191, 255, 255]
    assert light(torch.tensor([-1.0, 0.0, 1e9]).expand(3, 1, 3))[0, :, 0].tolist() == [0, 0, 255]
    assert not difference(torch.full((3, 2, 2), -0.5), torch.zeros(3, 2, 2)).any()


@pytest.mark.parametrize(("rows", "columns", "expected"), [
    ((10, 19), (12, 15), (slice(6, 24), slice(5, 23))), ((0, 3), (36, 39), (slice(0, 12), slice(28, 40))),
    ((0, 29), (0, 39), (slice(0, 30), slice(0, 40))),
])
def test_squares_hold_the_object_and_a_margin(rows: tuple[int, int], columns: tuple[int, int],
                                              expected: tuple[slice, slice]) -> None:
    inside = np.zeros((30, 40), bool)
    inside[rows[0], columns[0]] = inside[rows[1], columns[1]] = True
    assert square(inside) == expected
    shown = cropped({"a": np.zeros((30, 40, 3), np.uint8)}, torch.from_numpy(inside)[None])
    assert shown["a"].shape[:2] == tuple(part.stop - part.start for part in expected)


def test_best_median_and_worst_are_shown_with_their_figures(dataset: LightingDataset) -> None:
    contenders = [contender("net", trained(product)), contender("half", trained(lambda inputs: inputs.s_prime / 2))]
    rows = list(evaluate(contenders, dataset, range(EXAMPLES)))
    sheet = example_rows(rows, contenders, dataset)
    ranked = sorted((row for row in rows if row.method == "net"), key=lambda row: -row.metrics.psnr)
    assert [row.lines[0] for row in sheet[::2]] == [f"best: {ranked[0].key}", f"median: {ranked[2].key}",
                                                    f"worst: {ranked[4].key}"]
    assert [row.lines[1] for row in sheet] == ["net", "half"] * 3
    half = next(row for row in rows if row.method == "half" and row.key == ranked[4].key)
    assert f"PSNR {half.metrics.psnr:.2f} dB" in sheet[5].lines and half.object in sheet[5].lines


def evaluate_verb(folder: Path, *checkpoints: Path, **options: str) -> int:
    """Exit code of the verb on the CPU."""
    given = [part for path in checkpoints for part in ("--checkpoint", str(path))]
    return main(["evaluate", str(folder), *given, "--device", "cpu",
                 *(part for name, value in options.items() for part in (f"--{name}", value))])


def test_the_verb_writes_tables_and_pictures(folder: Path, checkpoint: Path, tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate_verb(folder, checkpoint, out=str(tmp_path), examples="4") == 0
    assert {path.name for path in tmp_path.iterdir()} == {"table.csv", "summary.md", "summary.png", "examples.png"}
    with (tmp_path / "table.csv").open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    dataset = LightingDataset(folder, "evaluation", DataSpec())
    (name, net), = load_all([checkpoint], "cpu").items()
    expected = list(evaluate([contender(name, net), *trivial()], dataset, [0, 1, 3, 4]))
    assert [(line["key"], line["method"]) for line in lines] == [(row.key, row.method) for row in expected]
    for line, row in zip(lines, expected, strict=True):
        assert [float(line[metric.name]) for metric in METRICS] == pytest.approx(
            [getattr(row.metrics, metric.name) for metric in METRICS], rel=1e-4)
    mean = np.mean([row.metrics.psnr for row in expected if row.method == "lightnet"])
    summary = (tmp_path / "summary.md").read_text()
    assert f"| {mean:.2f} ± " in summary and "4 examples, 4 views, 2 objects" in summary
    assert "trained on this split" not in summary
    with Image.open(tmp_path / "examples.png") as picture:
        assert picture.width > 9 * 160 and picture.height > 3 * 160
    shown = capsys.readouterr().out
    assert f"{mean:.2f} ± " in shown and "lightnet against copy_i_s" in shown and str(tmp_path) in shown


def test_remembering_is_not_passed_off_as_learning(folder: Path, tmp_path: Path) -> None:
    own = write_checkpoint(tmp_path / "best.pt", dataset="synthetic")
    assert evaluate_verb(folder, own, split="train") == 0
    assert "A method was trained on this split" in (tmp_path / "evaluation" / "summary.md").read_text()


@pytest.mark.parametrize(("options", "said"), [
    ({"split": "elsewhere"}, "expected elsewhere, got train, evaluation"),
    ({"checkpoint": "missing.pt"}, "missing.pt: expected a checkpoint, found no file"),
    ({"checkpoint": "other.pt"}, "other.pt: expected a checkpoint"),
])
def test_what_is_wrong_is_told(options: dict[str, str], said: str, folder: Path, checkpoint: Path, tmp_path: Path,
                               capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.pt").write_bytes(b"no checkpoint at all")
    assert evaluate_verb(folder, checkpoint, out="out", **options) == 2
    assert said in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_place_that_cannot_be_written_is_told_before_anything_is_predicted(
        folder: Path, checkpoint: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("x")
    monkeypatch.setattr("dataset_builder.lightnet.results.evaluate.evaluate", lambda *_: pytest.fail("predicted"))
    assert evaluate_verb(folder, checkpoint, out=str(tmp_path / "file")) == 2
    assert "file: cannot be written" in capsys.readouterr().err


def compose_verb(*arguments: object) -> int:
    """Exit code of the verb on the CPU."""
    return main(["compose", *map(str, arguments), "--device", "cpu"])


def test_examples_are_composed_into_files(folder: Path, checkpoint: Path, tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    assert compose_verb(folder, "--checkpoint", checkpoint, "--index", 1, "--out", tmp_path / "one") == 0
    example = open_dataset(folder)["evaluation", 1]
    image = exr.read((tmp_path / "one" / "composite.exr").read_bytes())
    outside = example["mask"][..., 0] == 0
    assert image.layer == "composite" and np.array_equal(image.pixels[outside], example["i_t"][outside])
    assert not np.array_equal(image.pixels, example["i_t"])
    for name in ("composite.png", "side_by_side.png"):
        with Image.open(tmp_path / "one" / name) as picture:
            assert picture.size == (40, 40) or picture.width > 5 * 320
    shown = capsys.readouterr().out
    assert example["meta"]["key"] in shown and "filled at the rim" in shown
    assert compose_verb(folder, "--checkpoint", checkpoint, "--example", example["meta"]["key"],
                        "--out", tmp_path / "two") == 0
    assert (tmp_path / "two" / "composite.exr").read_bytes() == (tmp_path / "one" / "composite.exr").read_bytes()


def test_files_of_ones_own_are_composed(folder: Path, checkpoint: Path, tmp_path: Path) -> None:
    example = open_dataset(folder)["evaluation", 1]
    given = list[object]()
    for option, name in (("--i-s", "i_s"), ("--s-prime", "s_prime"), ("--mask", "mask"), ("--background", "i_t"),
                         ("--mask-rough", "mask_rough")):
        path = tmp_path / f"{name}.exr"
        path.write_bytes(exr.encode(example[name], layer=name, key="0", dtype="float32"))
        given += [option, path]
    assert compose_verb(*given, "--checkpoint", checkpoint, "--out", tmp_path / "files") == 0
    assert compose_verb(folder, "--index", 1, "--checkpoint", checkpoint, "--out", tmp_path / "example") == 0
    one, other = ((tmp_path / name / "composite.exr").read_bytes() for name in ("files", "example"))
    assert np.array_equal(exr.decode(one), exr.decode(other))


def test_compose_wants_a_dataset_or_files(folder: Path, checkpoint: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert compose_verb("--checkpoint", checkpoint, "--i-s", "a.exr") == 2
    assert "--s-prime, --mask, --background or --empty missing" in capsys.readouterr().err
    assert compose_verb(folder, "--checkpoint", checkpoint, "--mask", "a.exr") == 2
    assert "expected a dataset or files, got both" in capsys.readouterr().err


def test_damaged_shards_are_told(folder: Path, checkpoint: Path, tmp_path: Path,
                                 capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(folder, tmp_path / "damaged")
    shard = next((tmp_path / "damaged" / "shards").glob("*-evaluation-*"))
    shard.write_bytes(shard.read_bytes()[:-512])
    assert evaluate_verb(tmp_path / "damaged", checkpoint, out=str(tmp_path / "out")) == 2
    assert "bytes" in capsys.readouterr().err
