"""Flicker by its laws: none where nothing changes, that of noise as statistics has it, and only between neighbours."""

from collections.abc import Callable
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
import torch

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.batch import Batch, Prediction
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.ranges import linear_light
from dataset_builder.lightnet.results.evaluate import Contender, ScoreRow, evaluate
from dataset_builder.lightnet.results.sequences import (
    TRUTH,
    FlickerRow,
    evaluate_sequences,
    sequence_split,
    sequences_of,
)
from dataset_builder.lightnet.results.spreads import spread, steadiness
from dataset_builder.lightnet.settings import DataSpec
from tests.lightnet.synthetic import write_synthetic
from tests.lightnet.turning_set import write_turning

Rows = tuple[list[ScoreRow], list[FlickerRow]]


def opened(folder: Path) -> LightingDataset:
    return LightingDataset(folder, "turn", DataSpec())


def measured(folder: Path, **contenders: Callable[[Batch], torch.Tensor]) -> Rows:
    dataset = opened(folder)
    named = [Contender(name=name, find=lambda batch, find=find: Prediction(i_t=find(batch)))
             for name, find in contenders.items()]
    rows = list(evaluate_sequences(named, dataset, sequences_of(dataset)))
    return ([row for row in rows if isinstance(row, ScoreRow)], [row for row in rows if isinstance(row, FlickerRow)])


def grey(batch: Batch) -> torch.Tensor:
    """The same light from everywhere, whatever the exposure."""
    return 0.3 * batch.exposure[:, None, None, None] * batch.inputs.inside.expand(-1, 3, -1, -1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A matte ball and a matte box, seen from five sides each; not to be changed."""
    return write_turning(tmp_path_factory.mktemp("turning") / "turning", sequences=2)


def test_a_target_that_turns_is_followed(tmp_path: Path) -> None:
    """One world turned about the vertical as a whole, target and camera, is the other."""
    still, turning = (measured(write_turning(tmp_path / f"set{angle:g}", frames=3, turned=angle),
                               truth_again=lambda batch: batch.truth.i_t)[1] for angle in (0.0, 40.0))
    assert [row.flicker for row in turning] == pytest.approx([row.flicker for row in still], rel=1e-6)
    assert [row.overlap for row in turning] == pytest.approx([row.overlap for row in still]) and still[0].overlap > 0.5


def test_what_looks_the_same_from_all_sides_does_not_flicker(folder: Path) -> None:
    scores, rows = measured(folder, grey=grey, truth_again=lambda batch: batch.truth.i_t)
    assert len(rows) == 3 * 2 * 4 and len(scores) == 2 * 2 * 5
    own = {name: [row for row in rows if row.method == name] for name in ("grey", "truth_again", TRUTH)}
    assert max(row.flicker for row in own["grey"]) < 1e-6
    # Matte surfaces under a light that stays: what is left is bilinear, over pixels of a ball of 20 across
    assert 0 < max(row.flicker for row in own[TRUTH]) < 4e-3
    assert [row.flicker for row in own["truth_again"]] == [row.flicker for row in own[TRUTH]]
    assert {row.error_flicker for row in own["truth_again"]} == {0.0}
    assert all(row.error_flicker == pytest.approx(truth.flicker, abs=1e-6)
               for row, truth in zip(own["grey"], own[TRUTH], strict=True))
    assert all(0.4 < row.overlap < 0.95 for row in rows)


def test_a_highlight_that_follows_the_view_flickers_in_truth(tmp_path: Path, folder: Path) -> None:
    glossy = measured(write_turning(tmp_path / "glossy", gloss=0.2))[1]
    matte = [row for row in measured(folder)[1] if row.sequence == "turn-00-00-0-0"]
    assert np.mean([row.flicker for row in glossy]) > 5 * np.mean([row.flicker for row in matte])


def test_independent_noise_flickers_by_two_sigma_over_root_pi(tmp_path: Path) -> None:
    """The view stands still, so that pixels meet pixels: |a - b| of two normal values of deviation sigma has the mean
    2 sigma / sqrt(pi) and the deviation sigma sqrt(2 - 4 / pi). One in 15,000 right programs fails at 4 errors."""
    folder, sigma, seed = write_turning(tmp_path / "still", step=0.0, frames=6), 0.02, torch.Generator().manual_seed(3)

    def noisy(batch: Batch) -> torch.Tensor:
        noise = sigma * torch.randn(batch.truth.i_t.shape, generator=seed, dtype=torch.float64)
        return linear_light(0.5 + noise) * batch.inputs.inside * batch.exposure[:, None, None, None] / exposure

    dataset = opened(folder)
    exposure = float(np.exp(np.mean([np.log(dataset.part(index).exposure) for index in range(6)])))
    _, rows = measured(folder, noisy=noisy)
    own = [row for row in rows if row.method == "noisy"]
    assert [row.frame for row in own] == [0, 1, 2, 3, 4] and all(row.overlap > 0.5 for row in own)
    inside = [int(dataset[index].inputs.inside.sum()) for index in range(5)]
    values = 3 * sum(row.overlap * count for row, count in zip(own, inside, strict=True))
    mean = sum(row.flicker * row.overlap * count for row, count in zip(own, inside, strict=True)) * 3 / values
    # Neighbouring differences share a picture: their correlation is at most 1/2, which twice the variance covers
    error = sigma * sqrt(2 - 4 / pi) * sqrt(2 / values)
    assert abs(mean - 2 * sigma / sqrt(pi)) < 4 * error and error < 0.02 * mean


def test_scores_are_those_of_the_examples(folder: Path) -> None:
    dataset = opened(folder)
    plain = list(evaluate([Contender(name="grey", find=lambda batch: Prediction(i_t=grey(batch)))], dataset, range(10)))
    scores, _ = measured(folder, grey=grey)
    assert [(row.key, row.metrics) for row in scores] == [(row.key, row.metrics) for row in plain]


def test_a_missing_view_has_no_neighbours(tmp_path: Path) -> None:
    folder = write_turning(tmp_path / "gap", frames=6, missing=(2,))
    sequence, = sequences_of(opened(folder))
    assert (sequence.name, sequence.frames, sequence.planned) == ("turn-00-00-0-0", (0, 1, 3, 4, 5), 6)
    assert [row.frame for row in measured(folder)[1]] == [0, 3, 4]


def test_deviations_are_over_views_and_within_sequences() -> None:
    found = spread([[1.0, 3.0], [11.0, 13.0], [7.0]])
    assert (found.mean, found.count) == (7.0, 5) and found.within == pytest.approx(sqrt(2))
    assert found.deviation == pytest.approx(np.std([1, 3, 11, 13, 7], ddof=1))
    assert spread([[1.0, 3.0], [5.0, 5.0]]).within == 1.0
    assert np.isnan(spread([[1.0]]).deviation) and np.isnan(spread([[1.0]]).within) and np.isnan(spread([[]]).mean)


def test_methods_come_with_the_truth_last_on_all_and_on_each(folder: Path) -> None:
    dataset = opened(folder)
    scores, flickers = measured(folder, grey=grey)
    rows = steadiness(scores, flickers, sequences_of(dataset), dataset.keys)
    names = ["", "turn-00-00-0-0", "turn-01-00-0-0"]
    assert [(row.method, row.sequence) for row in rows] == [(method, name) for method in ("grey", TRUTH)
                                                            for name in names]
    psnr = [score.metrics.psnr for score in scores]
    assert rows[0].metrics["psnr"].mean == pytest.approx(np.mean(psnr))
    assert rows[2].metrics["psnr"].deviation == pytest.approx(np.std(psnr[5:], ddof=1))
    assert rows[3].metrics == {} and rows[3].flickers["flicker"].count == 8


def test_what_has_no_sequence_or_no_depth_is_refused(tmp_path: Path, folder: Path) -> None:
    plain = write_synthetic(tmp_path / "plain", train=1, held_out=1, size=24)
    with pytest.raises(UserError, match=r"expected the layer depth, .* got none .build it with `depth: object`"):
        sequences_of(LightingDataset(plain, "evaluation", DataSpec()))
    with pytest.raises(UserError, match="expected a split with sequences, got train, evaluation without"):
        sequence_split(plain)
    with pytest.raises(UserError, match="expected sequences, got views that do not follow each other"):
        sequences_of(LightingDataset(folder, "train", DataSpec()))
    assert sequence_split(folder) == "turn"
