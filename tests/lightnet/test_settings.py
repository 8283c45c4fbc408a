"""Training files: defaults, the shipped ones, overrides, and errors with file and line."""

from pathlib import Path

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.lightnet.settings import TrainingSpec, load_training

FOLDER = Path(__file__).parents[2] / "scene_specs" / "training"


def test_nothing_written_is_all_defaults() -> None:
    assert load_training() == TrainingSpec()


def test_the_papers_weights_are_the_defaults() -> None:
    """Section 3.3: lambda 1, 2 and 3 are 0.05, 0.5 and 0.5, and D and R are supervised."""
    objective = TrainingSpec().objective
    assert (objective.dr, objective.fr, objective.dssim, objective.lab, objective.l1) == (1.0, 0.05, 0.5, 0.5, 0.0)


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_files_load(path: Path) -> None:
    assert path.stem.startswith(load_training(path).method)


def test_overrides_go_first(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("steps: 7\nmodel:\n  width: 8\n")
    spec = load_training(path, ["model.downs=3", "steps=9", "optimiser={rate: 1e-3}"])
    assert (spec.steps, spec.model.width, spec.model.downs, spec.optimiser.rate) == (9, 8, 3, 1e-3)


def test_all_errors_at_once_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("stesp: 7\nmodel:\n  width: 0\nmethod: lihgtnet\n")
    with pytest.raises(SpecError) as caught:
        load_training(path, ["data.batch=none", "data.crop.side=3"])
    text = str(caught.value)
    for part in (f"{path}:1: stesp", "(nearest known key: steps)", f"{path}:3: model.width", f"{path}:4: method",
                 "--set data.batch=none: data.batch"):
        assert part in text


def test_a_split_is_not_held_out_from_itself() -> None:
    with pytest.raises(SpecError, match="held_out: expected another split than train's, got train"):
        load_training(None, ["data.held_out=train"])
