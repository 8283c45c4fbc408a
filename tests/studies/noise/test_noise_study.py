"""The study of noise: only S' repeats, levels are compared on what all of them kept, and a small one end to end."""

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.label.example_label import RenderRecord
from dataset_builder.label.roughness_record import RoughnessRecord
from dataset_builder.lightnet.measures.metrics import METRICS, Metrics
from dataset_builder.lightnet.results.evaluate import ScoreRow, evaluate, trivial
from dataset_builder.lightnet.settings import load_training
from dataset_builder.report.noise_page import noise_sentence, quality_figure, sentences
from dataset_builder.studies.noise.axes import AXES, axis_of
from dataset_builder.studies.noise.level_trainings import MIXED, HeldOut, held_out, jobs
from dataset_builder.studies.noise.levels import OWN, Level, chosen, levels_of, trained_on, write_table
from dataset_builder.studies.noise.noise_study import NoiseStudy, count_passes, pass_lines, require
from dataset_builder.studies.noise.study_levels import parse_levels
from dataset_builder.studies.trainings import base_of
from tests.lightnet.synthetic import PAPER_AND_ROUGH, write_synthetic
from tests.plans import render_record
from tests.small_specs import write_spec

TINY = ("model={width: 4, downs: 2}", "data={crop: 16, batch: 2, workers: 0, held_out: test}",
        "check={every: 2, examples: 1}", "steps=2")
LAYERS = "layers={i_s: object, i_t: object, d: object, r: object, s_prime: object, mask: object, mask_rough: object}"
SETTINGS = (LAYERS, "storage.standard_errors=true", "render.spp=4", "render.max_depth=2", "gates.mask_overlap=0.2",
            "splits.test.lights=2", "splits.train.objects.count=1")
LEVELS = "0,0.008,0.016"
FIELD = ("views=8", "size=16", "held_out=1", "spp=4", "resolution=32", "steps=10", "gates={psnr: 0, opacity_iou: 0}")
WITH_FIELD = f"{LEVELS},density"


def made(spec: Path, out: Path, levels: str = WITH_FIELD, *overrides: str) -> NoiseStudy:
    return NoiseStudy(spec=spec, overrides=(*SETTINGS, *overrides), levels=parse_levels(levels, FIELD), out=out,
                      training=base_of(load_training(None, TINY)), per_level_steps=1, device="cpu", backend="llvm",
                      workers=1)


def run(spec: Path, out: Path) -> int:
    """Exit code of the study as a user runs it."""
    return main(["study", "noise", str(spec), "--out", str(out), "--levels", WITH_FIELD, "--per-level-steps", "1",
                 "--backend", "llvm", "--workers", "1", "--device", "cpu", "--x", "roughness_rms",
                 *(text for override in SETTINGS for text in ("--set", override)),
                 *(text for key in FIELD for text in ("--field", key)),
                 *(text for override in TINY for text in ("--train-set", override))])


def lines(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


# What is asked

@pytest.mark.parametrize(("levels", "overrides", "rule"), [
    ("0.004,0.002", (), "each larger than the one before, got 0.004, 0.002"),
    ("0.004", (), "at least two numbers"),
    ("0,0.01", ("layers={i_s: object, mask: object}",), "has no d, r, i_t, s_prime"),
    ("0,0.01", ("splits.test.name=other",), "expected a split test, got train, other"),
    ("0,0.01,density,density", (), "expected each field once"),
    ("0,light", (), "expected numbers or names, not both, got sigma 0, light"),
    ("0,0.01,density", ("splits.test.source={kind: field, gives: [r3dm]}",),
     r"splits\.test\.source\.gives: expected \[i_s\]"),
])
def test_what_cannot_be_studied_is_refused_before_it_is_built(small_spec: Path, tmp_path: Path, levels: str,
                                                              overrides: Sequence[str], rule: str) -> None:
    with pytest.raises(UserError, match=rule):
        require(made(small_spec, tmp_path, levels, *overrides))


def test_weights_of_vgg_are_looked_at_before_anything_is_rendered(small_spec: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"none.pth: expected a file, found none"):
        require(replace(made(small_spec, tmp_path, "0,0.01"), vgg_weights=tmp_path / "none.pth"))


def test_trainings_differ_in_levels_and_steps_alone(small_spec: Path, tmp_path: Path) -> None:
    found = jobs(made(small_spec, tmp_path, "0,0.01"))
    assert {name: (job.levels, job.spec.steps) for name, job in found.items()} == {
        MIXED: ((), 2), "level 0": ((0,), 1), "level 1": ((1,), 1)}
    assert len({job.spec.model_copy(update={"steps": 0}).model_dump_json() for job in found.values()}) == 1
    assert len({job.out for job in found.values()}) == 3
    assert [trained_on(name) for name in (*found, "copy_i_s")] == ["all", "0", "1", "nothing"]


def test_any_measured_figure_may_be_the_axis(small_spec: Path, tmp_path: Path) -> None:
    """The table has every figure of a label's rough mesh, and says what else there is."""
    figures = set(RoughnessRecord.model_fields) | {"roughness_rms", "roughness_max"}
    assert set(AXES) == figures
    with pytest.raises(UserError, match=r"--x: expected one of roughness_rms, .*, s_relmse, got colour"):
        require(replace(made(small_spec, tmp_path, "0,0.01"), x="colour"))
    rough = dict.fromkeys(RoughnessRecord.model_fields, 0.0) | {"normal_median": 7.0, "s_relmse": (0.25,)}
    record = render_record(roughness_rms=0.5, roughness=(rough,))
    assert [axis_of(name).value(record) for name in ("roughness_rms", "normal_median", "s_relmse")] == [0.5, 7, 0.25]
    assert axis_of("roughness_rms").shown(0.004) == "0.4 %" and axis_of("normal_median").shown(7.0) == "7"


@pytest.mark.parametrize("record", [render_record(), render_record(roughness=(
    dict.fromkeys(RoughnessRecord.model_fields, 0.0) | {"s_relmse": ()},))])
def test_labels_without_the_axis_end_in_words(record: RenderRecord) -> None:
    with pytest.raises(UserError, match="--x: expected labels with s_relmse, got one without"):
        axis_of("s_relmse").value(record)


# What is compared

@pytest.fixture(scope="module")
def uneven(tmp_path_factory: pytest.TempPathFactory) -> tuple[NoiseStudy, HeldOut]:
    """Five held-out examples at three levels: the second view lacks the last one."""
    out = tmp_path_factory.mktemp("uneven")
    write_synthetic(out / "dataset", train=3, held_out=5, size=24, levels=3)
    training = base_of(load_training(None, [*TINY, "data.held_out=evaluation"]))
    study = NoiseStudy(spec=out / "none.yaml", overrides=(), levels=parse_levels("0.005,0.01,0.016"), training=training,
                       per_level_steps=1, out=out, device="cpu")
    return study, held_out(study)


def scores(split: HeldOut, psnr: dict[str, Sequence[float]]) -> list[ScoreRow]:
    """Rows of methods whose PSNR depends on the level alone, and on the case by a little."""
    cases = {case: number for number, case in enumerate(split.cases)}
    return [ScoreRow(method=method, key=one.key, view=one.case[0], object=f"object {cases[one.case]}", room="r",
                     level=one.level, sigma=0.0, seconds=1.0,
                     metrics=Metrics(l1=0.1, psnr=values[one.level] + 0.01 * cases[one.case], ssim=0.5, lab=0.1))
            for method, values in psnr.items() for one in split.examples]


PSNR = {MIXED: (25.0, 24.5, 24.0), "level 0": (25.5, 22.0, 20.0), "level 1": (23.0, 24.9, 23.0),
        "level 2": (20.0, 22.0, 24.4), "dr_s_prime": (30.0, 26.0, 22.0), "copy_i_s": (11.0, 11.0, 11.0)}


def test_levels_are_compared_on_what_all_kept(uneven: tuple[NoiseStudy, HeldOut]) -> None:
    study, split = uneven
    assert len(split.dataset) == 5 and len(split.examples) == 3 and split.left_out == 1
    assert [example.level for example in split.examples] == [0, 1, 2]
    levels = levels_of(study, split, scores(split, PSNR))
    # 0.8 sigma is what the synthetic records state; sigma rises in thirds of 0.016
    assert [level.measured for level in levels] == pytest.approx([0.8 * 0.016 * (n + 1) / 3 for n in range(3)])
    assert [level.mean(OWN, "psnr").mean for level in levels] == [25.5, 24.9, 24.4]
    assert levels[2].less(MIXED, "dr_s_prime", "psnr").mean == pytest.approx(2.0)
    assert levels[2].less(MIXED, MIXED, "psnr", at=levels[0]).mean == pytest.approx(-1.0)
    text = " ".join(sentences(levels))
    assert "changes by -8.00 dB" in text and "changes by -1.00 dB" in text and "+2.00 dB against (D + R) S'" in text
    assert "not told apart" in text, "one object tells nothing of others"


def test_the_noise_of_the_truth_is_told_where_it_is_known(uneven: tuple[NoiseStudy, HeldOut], tmp_path: Path) -> None:
    """By the same code as evaluations: (D + R) S' on made examples with errors of a tenth."""
    study, split = uneven
    assert "ceiling unknown: the dataset has no i_t_se" in noise_sentence(study, levels_of(study, split,
                                                                                           scores(split, PSNR)))
    known = replace(study, out=tmp_path)
    write_synthetic(known.dataset, train=3, held_out=6, size=40, levels=3, layers=(*PAPER_AND_ROUGH, "i_t_se"))
    split = held_out(known)
    rows = list(evaluate(trivial(), split.dataset, range(6)))
    levels = levels_of(known, split, rows)
    for level in levels:
        own = [row for row in rows if row.method == "dr_s_prime" and row.level == level.number]
        assert level.noise_known and len(own) == 2
        for metric in METRICS:
            ceiling, corrected = (np.mean([getattr(getattr(row, part), metric.name) for row in own])
                                  for part in ("ceiling", "corrected"))
            assert level.ceiling[metric.name].mean == pytest.approx(ceiling)
            assert level.mean("dr_s_prime", metric.name, "corrected").mean == pytest.approx(corrected)
    assert noise_sentence(known, levels).startswith("noise ceiling: L1 ")
    write_table(levels, tmp_path / "levels.csv", axis_of(known.axis))
    written = {(row["level"], row["by"]): float(row["psnr_ceiling"]) for row in lines(tmp_path / "levels.csv")}
    assert written["2", "copy_i_s"] == pytest.approx(levels[2].ceiling["psnr"].mean, rel=1e-5)


def test_a_study_without_a_case_at_all_levels_ends_in_words(uneven: tuple[NoiseStudy, HeldOut]) -> None:
    study, split = uneven
    with pytest.raises(UserError, match=r"got none: lower the largest level, or widen gates\.mask_overlap"):
        levels_of(study, HeldOut(dataset=split.dataset, examples=(), left_out=2), [])


def test_the_cases_shown_are_the_median_and_the_worst() -> None:
    rows = tuple(ScoreRow(method=MIXED, key=str(n), view="", object="", room="", level=0, sigma=0.0, seconds=0.0,
                          metrics=Metrics(l1=0, psnr=psnr, ssim=0, lab=0)) for n, psnr in enumerate((21.0, 19.0, 30.0)))
    level = Level(number=0, asked=parse_levels("0")[0], measured=0.0, scores={MIXED: rows})

    class Split:
        cases = (("a", 0), ("b", 0), ("c", 0))
    assert chosen(Split(), [level]) == {"median": 0, "worst": 1}  # type: ignore[arg-type]


def test_levels_lie_where_they_were_measured(uneven: tuple[NoiseStudy, HeldOut]) -> None:
    study, _ = uneven
    deep = replace(study, x="roughness_max")
    levels = levels_of(deep, split := held_out(deep), scores(split, PSNR))
    assert [level.measured for level in levels] == pytest.approx([2.5 * 0.016 * (n + 1) / 3 for n in range(3)])
    figure = quality_figure(levels, "", axis_of("roughness_max"))
    assert figure.axes[0].get_xlabel() == "largest distance of a vertex, % of the bounding radius"
    drawn = figure.axes[0].containers[0].lines[0].get_xdata()
    assert list(drawn) == pytest.approx([100 * level.measured for level in levels])
    write_table(levels, study.out / "table.csv", axis_of("roughness_max"))
    written = sorted({float(row["roughness_max"]) for row in lines(study.out / "table.csv")})
    assert written == pytest.approx([level.measured for level in levels], rel=1e-5)


# The whole of it

@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The small spec at three levels of noise and one of a field, studied; (spec, out)."""
    spec, out = write_spec(tmp_path_factory.mktemp("noise")), tmp_path_factory.mktemp("out") / "study"
    assert run(spec, out) == 0
    return spec, out


def test_only_the_rough_mesh_is_rendered_again(studied: tuple[Path, Path]) -> None:
    """Two views, two lights each, four levels: counted from what the build wrote of every example."""
    spec, out = studied
    study = made(spec, out)
    found = {one.name: one for one in count_passes(study)}
    assert {name: (one.ran, one.examples) for name, one in found.items()} == {
        "first_hit": (2, 16), "source": (2, 16), "target": (4, 16), "lighting": (4, 16), "rough": (16, 16),
        "first_hit_rough": (16, 16)}
    assert {name for name, one in found.items() if not one.once} == {"rough", "first_hit_rough"}
    steps = Counter(line["step"] for line in lines(out / "dataset" / "seconds.csv"))
    assert steps["target"] == 4 and steps["rough"] == 16
    text = "\n".join(pass_lines(list(found.values())))
    assert "rough (S'): ran 16 times for 16 examples, once per example" in text
    assert "target (I_t): ran 4 times for 16 examples, once per view and light" in text


def test_every_level_has_figures_of_every_training(studied: tuple[Path, Path]) -> None:
    _, out = studied
    rows = lines(out / "levels.csv")
    names = {"mixed", *(f"level {n}" for n in range(4)), "copy_i_s", "d_s_prime", "dr_s_prime"}
    assert {(row["level"], row["by"]) for row in rows} == {(str(n), name) for n in range(4) for name in names}
    roughness = [float(row["roughness"]) for row in rows if row["by"] == "mixed" and row["rough"] != "density"]
    # Isotropic noise moves vertices by sigma across the surface, which is what distance sees of it, and less on edges
    assert np.all(np.diff(roughness) > 0.002) and 0.5 * 0.016 < roughness[-1] < 1.7 * 0.016
    assert roughness[0] < 1e-4, "no subdivision, no noise"
    noisy = {row["level"]: float(row["psnr"]) for row in rows if row["by"] == "dr_s_prime"}
    assert noisy["0"] > noisy["2"] + 1
    like = lines(out / "likeness.csv")
    assert {line["by"] for line in like} == {"normal_median", "to_clean_rms", "s_relmse", "cost"}
    assert len(like) == 4 * 2 and {line["rough"] for line in like} == {"density"}


def test_the_report_has_its_figures(studied: tuple[Path, Path]) -> None:
    _, out = studied
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") >= 2 and "once per view and light" in page
    assert "not the paper" in page and "told apart" in page
    assert "How much of it is noise of the truth?" in page and "<td>noise ceiling</td>" in page
    assert (out / "figures" / "quality.png").stat().st_size > 20_000
    assert (out / "figures" / "crops-median.png").stat().st_size > 5_000


def test_a_second_run_makes_nothing_again(studied: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    spec, out = studied
    before = {path: path.stat().st_mtime_ns for path in [*out.rglob("*.tar"), *out.rglob("last.pt"),
                                                        *out.rglob("scores.csv")]}
    table = (out / "levels.csv").read_bytes()
    capsys.readouterr()
    assert run(spec, out) == 0
    printed = capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in before} == before and len(before) == 8 + 5 + 1
    assert (out / "levels.csv").read_bytes() == table
    assert "rough (S'): ran 16 times" in printed and "step 1," not in printed
