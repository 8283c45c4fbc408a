"""`verify` and the summary name layers whose means rare bright paths decide; nothing is wrong with them."""

from dataclasses import replace
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from dataset_builder.label.example_label import LayerAccuracy
from dataset_builder.report.dataset_summary import summary_tables
from tests.shards.tiny_dataset import build, default_examples


def accuracy(name: str, known: str) -> LayerAccuracy:
    figures = dict.fromkeys((f"{prefix}relative_error{suffix}" for prefix in ("", "object_") for suffix in ("", "_95")),
                            0.1)
    return LayerAccuracy.model_validate({"name": name, "stopped": "spp", "mean_error": 0.02, "mean_known": known,
                                         **figures})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four examples, of which the second and the last, of the test split, do not know `i_t`, the last not `s_prime`."""
    examples = default_examples()
    for index, example in examples.items():
        layers = (accuracy("i_s", "widened"), accuracy("i_t", "unknown" if index in (1, 3) else "known"),
                  accuracy("s_prime", "unknown" if index == 3 else "known"))
        examples[index] = replace(example, record=example.record.model_copy(update={"layers": layers}))
    build(tmp_path / "tiny", examples)
    return tmp_path / "tiny"


@pytest.mark.parametrize(("options", "said"), [
    ((), "means not known: i_t of 2 examples, s_prime of 1 example\n"),
    (("--split", "train"), "means not known: i_t of 1 example\n"), (("--depth", "member"), "")])
def test_verify_names_them(folder: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...],
                           said: str) -> None:
    assert main(["verify", str(folder), "--workers", "1", *options]) == 0
    out = capsys.readouterr().out
    assert "no problems found" in out and said in out and ("means" in out) == bool(said)


def test_a_dataset_whose_means_are_known_says_nothing(dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(dataset), "--workers", "1"]) == 0
    assert "means" not in capsys.readouterr().out


def test_the_summary_names_them(folder: Path) -> None:
    captions = [str(table.caption) for table in summary_tables(folder)]
    assert "means not known: i_t of 2 examples, s_prime of 1 example" in captions
