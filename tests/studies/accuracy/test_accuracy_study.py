"""The whole accuracy study on two tiny examples: its files, and figures that follow their laws."""

import math
import re
import shlex
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.report.accuracy_answers import summary_lines, trust_sentences
from dataset_builder.report.accuracy_laws import law_figure
from dataset_builder.spec.load import load_dataset
from dataset_builder.studies.accuracy import accuracy_study
from dataset_builder.studies.accuracy.conclusions import Conclusions, read_conclusions
from dataset_builder.studies.accuracy.curves import curve
from dataset_builder.studies.accuracy.rows import (
    COLUMNS,
    WHOLE,
    AccuracyRow,
    begin,
    kept_steps,
    of,
    read_table,
    write_table,
)
from dataset_builder.studies.effects import effects_study
from dataset_builder.studies.sampled import StudySpec
from tests.small_specs import write_spec

TINY = ("--set", "image={width: 16, height: 16}", "--set", "rough.edge_length=0.3", "--backend", "llvm")
ASKED = ("--error", "i_t=0.7", "s_prime=0.5", "--count", "12000", "--gpu-speed", "50")
FIGURES = {"laws", "spread", "adaptive", "uniform-denoised", "depth", "edge-length", "texture-size", "codecs",
           "accumulation"}


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small dataset's spec."""
    return write_spec(tmp_path_factory.mktemp("spec"))


@pytest.fixture(scope="module")
def out(spec: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished study."""
    folder = tmp_path_factory.mktemp("study")
    assert main(["study", "accuracy", str(spec), *TINY, "--examples", "1", "--budget", "small", "--layers", "i_t",
                 "s_prime", *ASKED, "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def found(out: Path, spec: Path, rows: list[AccuracyRow]) -> Conclusions:
    """What it concludes, from its files."""
    return read_conclusions(rows, spec, out)


@pytest.fixture(scope="module")
def rows(out: Path) -> list[AccuracyRow]:
    """Its table."""
    return read_table(out / "results.csv")


def test_files_are_there(out: Path) -> None:
    assert {path.stem for path in (out / "figures").glob("*.png")} == FIGURES
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(FIGURES)
    assert not re.search(r'(?:src|href)="(?!data:)', page)
    assert (out / "results.csv").read_text().splitlines()[0] == ",".join(COLUMNS)


def test_an_interrupted_study_goes_on(out: Path, spec: Path, rows: list[AccuracyRow], tmp_path: Path,
                                      capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    measured = []
    for name in accuracy_study.MEASURES:
        monkeypatch.setitem(accuracy_study.MEASURES, name, lambda _, ref, name=name: iter(
            measured.append(name) or [row for row in rows if (row.example, accuracy_study.GROUPS[row.question])
                                      == (ref.key, name)]))
    (tmp_path / "study.json").write_bytes((out / "study.json").read_bytes())
    write_table([row for row in rows if accuracy_study.GROUPS[row.question] in ("sampling", "path depth")],
                tmp_path / "results.csv")
    words = ["study", "accuracy", str(spec), *TINY, *ASKED[3:], "--examples", "1", "--budget", "small", "--out",
             str(tmp_path)]
    assert main([*words, "--layers", "i_t", "s_prime"]) == 0
    assert measured == ["edge length", "texture size", "storage", "accumulation", *["other examples"] * 3]
    assert capsys.readouterr().out.count("kept from an earlier run") == 2
    assert (tmp_path / "results.csv").read_text() == (out / "results.csv").read_text()
    # Other layers are another study: nothing is kept, and nothing of the old one is left in its table
    measured.clear()
    assert main([*words, "--layers", "i_t"]) == 0
    assert set(measured) == set(accuracy_study.MEASURES) and "kept" not in capsys.readouterr().out


@pytest.mark.parametrize("content", [None, "", "question\nnone\n", "question,setting\nuniform,4 spp\n"])
def test_tables_that_are_damaged_are_measured_anew(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "results.csv").write_text(content)
    assert kept_steps(tmp_path / "results.csv", accuracy_study.GROUPS) == {}


def test_rows_about_something_else_step_aside_and_come_back(tmp_path: Path) -> None:
    table = tmp_path / "results.csv"
    begin(tmp_path, {"spec": "a"}, table)
    table.write_text("rows")
    begin(tmp_path, {"spec": "a"}, table)
    assert table.read_text() == "rows"
    begin(tmp_path, {"spec": "b"}, table)
    assert not table.exists() and "b" in (tmp_path / "study.json").read_text()
    table.write_text("others")
    begin(tmp_path, {"spec": "a"}, table)
    assert table.read_text() == "rows"
    begin(tmp_path, {"spec": "b"}, table)
    assert table.read_text() == "others"


def test_the_answer_is_that_of_the_files(out: Path, found: Conclusions, rows: list[AccuracyRow]) -> None:
    assert found.advice.lines() == (out / "recommended.txt").read_text()
    assert found.asked.errors == {"i_t": 0.7, "s_prime": 0.5} and found.asked.examples == 12_000
    page = (out / "report.html").read_text()
    assert found.answer is not None and f"{found.answer.gigabytes:.3g} GB" in page
    lines = "\n".join(summary_lines(found))
    assert "12,000 examples" in lines and "50 times as fast as a core" in lines and "nothing was measured" in lines
    assert lines.count("(recommended)") == 1 and "never recommended" in lines
    # The layer whose mean is known in the fewest examples decides how far the answer can be trusted
    known = min(sum(row.unknown != 1 for row in of(rows, "other-examples", layer)) for layer in ("i_t", "s_prime"))
    assert 0 < known <= 3 and f"WARNING: how examples differ is known from {known} of them" in lines


def test_the_layer_known_from_the_fewest_examples_is_told(out: Path, spec: Path, rows: list[AccuracyRow]) -> None:
    first = of(rows, "other-examples", "s_prime")[0].example
    changed = [replace(row, unknown=float((row.layer, row.example) == ("s_prime", first)))
               if row.question == "other-examples" else row for row in rows]
    said = "\n".join(trust_sentences(read_conclusions(changed, spec, out)))
    assert "how examples differ is known from 2 of them" in said
    assert "The mean of s_prime is not known in 1 of 3" in said and "The mean of i_t" not in said


def test_hours_are_those_of_the_passes(rows: list[AccuracyRow], found: Conclusions) -> None:
    """What the dataset takes at the samples that others were measured at is what they took, within a factor of two."""
    own = [row for row in rows if row.question == "other-examples"]
    assert len({row.example for row in own}) == 3 and min(row.cpu_seconds for row in own) > 0
    each = sum(row.cpu_seconds for row in own) / 3
    told = 3600 * found.answers.fixed({"source": 16, "target": 16, "rough": 16}).core_hours / 12_000
    assert each / 2 < told < 2 * each


def test_laws_are_drawn_with_what_was_asked(found: Conclusions) -> None:
    labels = [text for axes in law_figure(found).axes for text in axes.get_legend_handles_labels()[1]]
    assert sum(text.startswith("asked: ") for text in labels) == 2 and labels.count("00000000") == 2


@pytest.mark.parametrize(("kind", "module"), [("accuracy", accuracy_study), ("effects", effects_study)])
def test_more_examples_than_there_are_become_all(spec: Path, kind: str, module: ModuleType, tmp_path: Path,
                                                 monkeypatch: pytest.MonkeyPatch,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    def stop(study: accuracy_study.AccuracyStudy | effects_study.EffectsStudy) -> None:
        assert study.examples == whole == len(study.spec.sample(study.examples))
        raise UserError("far enough")

    whole = len(StudySpec(path=spec).planner().examples)
    monkeypatch.setattr(module, "run", stop)
    for asked in (100_000, whole + 1, whole):
        assert main(["study", kind, str(spec), "--examples", str(asked), "--out", str(tmp_path)]) == 2
        assert (f"{whole} examples, all that the spec has; {asked:,} were asked for" in capsys.readouterr().out) \
            == (asked > whole)


@pytest.mark.parametrize("word", ["i_t", "i_t=", "=0.1", "i_t=2", "i_t=-1", "i_t=x"])
def test_errors_that_are_none(spec: Path, word: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["study", "accuracy", str(spec), "--error", word])
    assert "expected" in capsys.readouterr().err


def test_recommended_options_are_taken_as_they_are(out: Path, spec: Path) -> None:
    words = shlex.split((out / "recommended.txt").read_text())
    assert "render.spp" in words[1] and "render.accuracy" in words[3]
    assert words[::2] == ["--set"] * (len(words) // 2) and len(words) >= 6
    assert load_dataset(spec, words[1::2]).dataset.name == "small"


def test_more_samples_are_better_and_the_reference_is_best(rows: list[AccuracyRow]) -> None:
    for layer in ("i_t", "s_prime"):
        points = curve(rows, "uniform", layer)
        assert {row.replicate for row in of(rows, "uniform", layer)} == {0, 1}
        assert [point.value for point in points] == [4, 16, 64]
        assert points[0].error > points[1].error > points[2].error
        own = of(rows, "uniform", layer)
        assert all(0 < row.relmse_reference < row.relmse_measured and row.paths > 0 for row in own)
        assert own[0].psnr < own[-1].psnr and own[0].flip > own[-1].flip


def test_a_tighter_goal_takes_more_paths_for_less_error(rows: list[AccuracyRow]) -> None:
    # Where the mean is not known a goal goes on for that: always of i_t in so small a picture, of s_prime in some runs
    for layer in ("i_t", "s_prime"):
        loose, tight = ([row for row in of(rows, "adaptive", layer) if row.value == goal] for goal in (0.4, 0.2))
        assert max(row.paths for row in (*loose, *tight)) <= 256 * 16 * 16
        assert min(row.reached for row in (*loose, *tight)) > 0
    assert min(row.paths for row in loose) < min(row.paths for row in tight)
    assert sum(row.relmse for row in loose) > sum(row.relmse for row in tight)


def test_longer_paths_miss_less(rows: list[AccuracyRow]) -> None:
    for layer in ("i_t", "s_prime"):
        bias = {row.value: row.bias for row in of(rows, "depth", layer)}
        assert bias[2] < bias[4] < 0.01 and abs(bias[8]) < abs(bias[2])


def test_finer_textures_are_better_and_nothing_else_changes(rows: list[AccuracyRow]) -> None:
    coarse, fine = of(rows, "texture-size", "d")
    assert coarse.value < fine.value and coarse.relmse > fine.relmse > 0


def test_half_is_smaller_and_off_by_its_rounding(rows: list[AccuracyRow]) -> None:
    size = {row.setting: row.bytes for row in of(rows, "codecs", WHOLE)}
    assert all(size[f"float16 {codec}"] < size[f"float32 {codec}"] for codec in ("none", "zip", "piz"))
    assert size["float32 zip"] < size["float32 none"]
    errors = {(row.setting, row.layer): row.error for row in of(rows, "codecs") if math.isfinite(row.relmse)}
    assert errors["float32", "i_t"] == 0 and 1e-5 < errors["float16", "i_t"] < 2**-11


def test_sums_are_closer_than_their_noise(rows: list[AccuracyRow]) -> None:
    drift = {(row.setting, row.value): row.drift for row in of(rows, "accumulation")}
    assert len({value for _, value in drift}) == 3
    for (_, count), value in drift.items():
        assert value <= drift["standard error of the mean", count]


def test_edges_are_counted(rows: list[AccuracyRow]) -> None:
    own = of(rows, "edge-length")
    assert [row.setting for row in own] == ["4 x", "2 x"] and own[0].triangles <= own[1].triangles


def test_examples_come_from_every_split(spec: Path) -> None:
    study = StudySpec(path=spec)
    refs = study.sample(4)
    assert {ref.view.pair.split for ref in refs} == {"train", "test"} and len(set(refs)) == 4
    assert study.sample(4) == refs and len(study.sample(1)) == 1
    assert len(study.sample(99)) == 10


def test_a_layer_that_the_dataset_does_not_hold(spec: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "accuracy", str(spec), "--layers", "air", "--out", str(tmp_path), "--backend", "llvm"]) == 2
    assert "expected some of i_s, i_t" in capsys.readouterr().err


@pytest.mark.parametrize("words, said", [
    (["--layers", "i_t", "nosuch"], "got nosuch"),
    (["--layers", "d"], "i_s, i_t, s_prime, s, spec, the dataset's layers with light, got d"),
    (["--error", "d=0.1"], "--error: expected some of"),
    (["--error", "i_t=0.1", "i_t=0.2"], "several for i_t")])
def test_layers_that_cannot_be_measured_are_refused_before_anything_is(
        spec: Path, tmp_path: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["study", "accuracy", str(spec), *words, "--out", str(out), "--backend", "llvm"]) == 2
    assert said in capsys.readouterr().err and not out.exists()
