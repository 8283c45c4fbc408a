"""Whatever learns from I_t or measures by it says so of a dataset without, and what to do instead."""

import re
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.lightnet.data.truth import problem_of
from tests.lightnet.formula_method import write_checkpoint
from tests.lightnet.synthetic import write_synthetic
from tests.small_specs import write_spec

INSTEAD = "where its objects are captures, which have none, use `dataset-builder compose` instead"
CAPTURE = ("i_s", "s_prime", "mask_rough", "i_t_empty", "i_pbr")


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset of what has no clean mesh."""
    return write_synthetic(tmp_path_factory.mktemp("truth") / "capture", train=2, held_out=1, size=24, layers=CAPTURE)


def test_other_layers_are_missing_for_other_reasons() -> None:
    assert problem_of("here", ("a", "b"), ("a", "b"), "read") is None
    found = problem_of("here", ("a",), ("a", "b"), "read")
    assert found and str(found) == ("here: layers: expected a, b to read, the dataset has no b (build it with these "
                                    "layers)")


@pytest.mark.parametrize("verb", ["train", "evaluate", "validate", "table"])
def test_every_verb_that_needs_the_truth_says_so(verb: str, capture: Path, tmp_path: Path,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path / "out")]
    options = {"train": [str(capture), *out], "table": ["methods", str(capture), *out],
               "evaluate": [str(capture), "--checkpoint", str(write_checkpoint(tmp_path / "last.pt")), *out],
               "validate": [str(capture), "--all", *out]}[verb]
    assert main([verb, *options]) != 0
    said = capsys.readouterr()
    text = said.out + said.err
    assert INSTEAD in text and "Traceback" not in text and re.search(r"the dataset has no [^(]*\bi_t\b", text)
    assert not (tmp_path / "out" / "last.pt").exists()


def test_the_study_of_noise_says_so_before_it_builds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec, out = write_spec(tmp_path), tmp_path / "out"
    layers = "layers={i_s: object, s_prime: object, mask_rough: object, i_t_empty: frame}"
    assert main(["study", "noise", str(spec), "--out", str(out), "--set", layers]) != 0
    assert INSTEAD in capsys.readouterr().err and not out.exists()
