"""The catalogue of hard cases on small sizes, and renderers broken on purpose that it must tell."""

import csv
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.rendering import passes, plugins
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.sampling import estimate
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.scene.local_frame import LocalFrame
from dataset_builder.studies.stress import cases, mesh_cases, refused_cases
from dataset_builder.studies.stress.case import SIZES, CaseMeasured, hard_case
from dataset_builder.studies.stress.cases import CASES, COLUMNS, markdown, run, run_all, select

PAGE = Path(__file__).parents[3] / "docs" / "stress.md"
SMALL = SIZES["small"]
COARSE = replace(SMALL, side=8, spp=4, replicas=4, long=4096, faces=5000)
BY_NAME = {case.name: case for case in CASES}
UNLIT = ("mesh/", "refused/", "number/denormals", "number/half-range", "number/long-sum")
"""Cases that render nothing."""
MASK_ONLY = ("number/mask-of-one-pixel", "number/empty-mask", "number/all-black-layer")
"""Cases that a black picture passes: theirs is black, or it is the mask that counts."""
LIT = [case for case in CASES if not case.name.startswith(UNLIT)]


@pytest.fixture(scope="module", autouse=True)
def backend():
    """A renderer that is switched on."""
    activate("llvm")
    plugins.register()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_case(case):
    result = run(case, SMALL)
    assert result.passed, f"{case.figure}: {result.figure:g}, at most {case.bound:g}; {'; '.join(result.wrong)}"


JOINED = ("light/", "material/closed-white-furnace", "material/metallic-1", "geometry/scaled")


@pytest.mark.parametrize("case", [case for case in CASES if case.name.startswith(JOINED)], ids=lambda case: case.name)
def test_cases_with_lamps_by_joined_paths(case):
    """`geometry/tiny-and-far` is not among them: rounding a kilometre from the origin sends some light paths another
    way, and each of them serves many pixels."""
    result = run(case, replace(SMALL, transport="joined"))
    assert result.passed, f"{case.figure}: {result.figure:g}, at most {case.bound:g}; {'; '.join(result.wrong)}"


def test_the_catalogue_is_a_catalogue():
    assert len(CASES) == len(BY_NAME) >= 50
    assert {name.split("/")[0] for name in BY_NAME} == {"light", "geometry", "mesh", "material", "number", "refused"}
    assert all(case.expectation and case.failure and case.figure for case in CASES)


def test_the_page_is_in_step():
    assert markdown(CASES) in PAGE.read_text(encoding="utf-8"), "run `dataset-builder stress --list`"


# Broken on purpose

def tampered(monkeypatch, change, name="radiance"):
    """Let a pass return what `change` makes of its means."""
    honest = getattr(passes, name)

    def dishonest(*given, **options):
        found = honest(*given, **options)
        return replace(found, mean=change(found.mean.copy(), passes))
    monkeypatch.setattr(passes, name, dishonest)


def faked(monkeypatch, value):
    """A renderer that sends one value for everything, at no cost."""
    channels = max(part.stop for part in passes.RADIANCE_CHANNELS.values())
    monkeypatch.setattr(passes, "radiance", lambda view, stage, pixels, **_: Estimate.exact(
        np.full((len(pixels), channels), value)))


@pytest.mark.parametrize("case", LIT, ids=lambda case: case.name)
def test_nan_is_told_by_every_case(case, monkeypatch):
    faked(monkeypatch, np.nan)
    assert not run(case, COARSE).passed


@pytest.mark.parametrize("case", [case for case in LIT if case.name not in MASK_ONLY], ids=lambda case: case.name)
def test_black_is_told_by_every_case(case, monkeypatch):
    faked(monkeypatch, 0.0)
    assert not run(case, COARSE).passed


def one_nan(mean, passes):
    mean[7, passes.RADIANCE_CHANNELS["shading"].start] = np.nan
    return mean


def below_zero(mean, passes):
    mean[7, passes.RADIANCE_CHANNELS["shading"].start] = -1e-9
    return mean


def brighter(mean, passes):
    return 1.02 * mean


def not_d_times_s(mean, passes):
    mean[:, passes.RADIANCE_CHANNELS["image"]] *= 1.01
    return mean


def one_firefly(mean, passes):
    mean[len(mean) // 2] *= 3
    return mean


def half_black(mean, passes):
    mean[len(mean) // 2:] = 0
    return mean


@pytest.mark.parametrize(("name", "change", "law"), [
    ("light/room-sized-square", one_nan, "finite"), ("light/grazing", below_zero, "negative"),
    ("light/room-sized-square", brighter, ""), ("material/albedo-1", brighter, ""),
    ("material/closed-white-furnace", brighter, ""), ("light/at-the-camera", not_d_times_s, "I = D S"),
    ("geometry/endless-floor", one_firefly, ""), ("light/two-sided", half_black, ""),
    ("number/long-render", lambda mean, passes: mean * (1 + 2e-5), ""), ("number/image-37x23", half_black, ""),
    ("number/seed-0", lambda mean, passes: np.tile(mean[:400], (len(mean) // 400, 1)), "random numbers"),
])
def test_a_tampered_picture_is_told(name, change, law, monkeypatch):
    tampered(monkeypatch, change)
    result = run(BY_NAME[name], SMALL)
    assert not result.passed
    assert bool(result.wrong) == bool(law) and all(law in reason for reason in result.wrong[:1])


@pytest.mark.parametrize("name", ["geometry/scaled-1e-3", "geometry/moved-1e4", "geometry/tiny-and-far"])
def test_a_scene_that_is_not_brought_to_its_frame_is_told(name, monkeypatch):
    monkeypatch.setattr(LocalFrame, "of", classmethod(lambda cls, corners: cls()))
    assert not run(BY_NAME[name], SMALL).passed


def test_a_drifting_sum_is_told(monkeypatch):
    honest = estimate.of_batches
    monkeypatch.setattr(estimate, "of_batches", lambda means, spp: honest(means * (1 - 1e-5), spp))
    assert not run(BY_NAME["number/long-sum"], SMALL).passed
    assert not run(BY_NAME["number/long-sum-of-unlike"], SMALL).passed


def test_subdivision_that_leaves_the_hull_is_told(monkeypatch):
    honest = mesh_cases.loop

    def swollen(mesh, **options):
        fine, creases = honest(mesh, **options)
        return replace(fine, positions=1.5 * fine.positions), creases
    monkeypatch.setattr(mesh_cases, "loop", swollen)
    for name in ("mesh/loop-valence-2", "mesh/loop-valence-3", "mesh/loop-valence-60", "mesh/loop-fan-of-five",
                 "mesh/large-subdivision"):
        assert not run(BY_NAME[name], SMALL).passed, name


def test_what_is_taken_though_it_should_be_refused_is_told(monkeypatch):
    monkeypatch.setattr(refused_cases, "pack", lambda materials: None)
    monkeypatch.setattr(refused_cases, "encode", lambda array, **_: b"")
    monkeypatch.setattr(refused_cases, "derive_seed", lambda seed: 0)
    for name in ("texture-nan", "texture-inf", "texture-negative", "texture-1e8", "material", "beyond-half",
                 "layer-nan", "seed"):
        result = run(BY_NAME[f"refused/{name}"], SMALL)
        assert not result.passed and "was taken" in result.wrong[0], name


# The runner

def case_of(figure, *wrong, bound=1.0, name="test/case"):
    @hard_case(name=name, expectation="e", failure="f", figure="g", bound=bound)
    def made(size):
        if isinstance(figure, Exception):
            raise figure
        return CaseMeasured(figure=figure, wrong=wrong)
    return made


@pytest.mark.parametrize(("case", "passed"), [
    (case_of(0.0), True), (case_of(1.0), True), (case_of(1.001), False), (case_of(float("nan")), False),
    (case_of(float("inf")), False), (case_of(-0.1), False), (case_of(0.0, "a broken law"), False),
    (case_of(0.0, bound=0.0), True), (case_of(RuntimeError("no")), False), (case_of(UserError("no")), False),
])
def test_verdicts(case, passed):
    assert run(case, SMALL).passed == passed


def test_a_case_that_breaks_down_does_not_stop_the_others():
    first, second = run_all([case_of(RuntimeError("gone")), case_of(0.0)], SMALL)
    assert first.wrong == ("RuntimeError: gone",) and np.isnan(first.figure)
    assert second.passed


def test_selection():
    assert {case.name for case in select(CASES, "refused/")} == {name for name in BY_NAME if name[:8] == "refused/"}
    assert [case.name for case in select(CASES, "*seed-?")] == ["number/seed-0"]
    with pytest.raises(UserError, match=r"--only: .*'nothing'.*light/touching"):
        select(CASES, "nothing")


def test_the_verb_passes(tmp_path, capsys):
    table = tmp_path / "tables" / "stress.csv"
    assert main(["stress", "--size", "small", "--only", "mesh/loop", "--backend", "llvm", "--csv", str(table)]) == 0
    printed = capsys.readouterr().out
    assert "5 cases, 5 passed, 0 failed," in printed.splitlines()[-1]
    rows = list(csv.DictReader(StringIO(table.read_text(encoding="utf-8"))))
    assert tuple(rows[0]) == COLUMNS and len(rows) == 5
    assert all(float(row["measured"]) <= float(row["bound"]) and row["passed"] == "1" for row in rows)


def test_the_verb_fails_where_a_case_fails(monkeypatch, capsys):
    monkeypatch.setattr(cases, "CASES", (case_of(2.5), case_of(0.0, "[red]a broken law", name="test/law")))
    assert main(["stress", "--size", "small", "--backend", "llvm"]) == 1
    printed = capsys.readouterr().out
    assert "g: expected at most 1, got 2.5" in printed and "[red]a broken law" in printed
    assert "2 cases, 0 passed, 2 failed," in printed.splitlines()[-1]


def test_the_verb_lists_what_stands_on_the_page(capsys):
    assert main(["stress", "--list", "--only", "number/seed"]) == 0
    rows = capsys.readouterr().out.splitlines()[2:]
    assert len(rows) == 2 and all(row in PAGE.read_text(encoding="utf-8") for row in rows)
