"""Spoilt copies are whole in every respect but the one that is meant."""

import json
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.verify import verify
from tests.lightnet.synthetic import PAPER_AND_ROUGH, write_synthetic
from tools.sabotage import KINDS, SHIFT, encoded, main, moved, partners, sabotage

ALLOWED = {"shuffle_s_prime": "outside", "shift_mask": "outside", "gamma_d": "reflectance", "gamma_r": "reflectance"}
"""Identity that a kind breaks by its nature; all others break none."""
CHANGED = {"swap_d_r": {"d", "r"}, "shift_mask": {"mask"}, "shift_mask_cut": {"mask", "d", "r"},
           "shift_object": {"mask", "mask_rough", "d", "r", "s_prime"}}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_synthetic(tmp_path_factory.mktemp("data") / "set", train=3, held_out=2, size=40)


def changed_by(kind: str) -> set[str]:
    return CHANGED.get(kind) or ({kind.removeprefix("gamma_")} if kind.startswith("gamma_") else {"s_prime"})


@pytest.mark.parametrize("kind", KINDS)
def test_copies_differ_in_what_is_meant_and_verify(dataset: Path, tmp_path: Path, kind: str) -> None:
    sabotage(dataset, tmp_path / "out", kind)
    problems = verify(tmp_path / "out")
    assert {problem.path.split(": ")[-1] for problem in problems} <= {ALLOWED.get(kind)}
    honest, spoilt = open_dataset(dataset), open_dataset(tmp_path / "out")
    assert honest.splits == spoilt.splits
    differing = {name for key in honest.splits["train"] for name in PAPER_AND_ROUGH
                 if not np.array_equal(honest[key][name], spoilt[key][name])}
    assert differing == changed_by(kind)
    for key in honest.splits["train"]:
        before, after = honest[key]["meta"], spoilt[key]["meta"]
        assert before["plan"] == after["plan"] and before["record"] == after["record"]
        assert after["layers"]["mask"]["max"] == spoilt[key]["mask"].max()


def test_outside_holds_where_s_prime_is_fitted(dataset: Path, tmp_path: Path) -> None:
    for kind in ("shuffle_s_prime_fitted", "shuffle_s_prime_matched"):
        sabotage(dataset, tmp_path / kind, kind)
    assert verify(tmp_path / "shuffle_s_prime_matched") == []
    honest, spoilt = open_dataset(dataset), open_dataset(tmp_path / "shuffle_s_prime_matched")
    for key in honest.splits["train"]:
        own, other = honest[key]["s_prime"], spoilt[key]["s_prime"]
        assert other.mean(axis=(0, 1)) == pytest.approx(own.mean(axis=(0, 1)), rel=1e-5)
        assert not np.allclose(own, other)


def test_nobody_is_their_own_partner() -> None:
    keys = [f"{number:08d}" for number in range(7)]
    found = partners(keys)
    assert sorted(found) == sorted(found.values()) == keys and all(key != other for key, other in found.items())


def test_the_curve_is_that_of_srgb() -> None:
    """0.5 is 0.735 on the curve of IEC 61966-2-1; the straight piece has a slope of 12.92."""
    linear = np.array([[[0.0, 0.001, 0.5]], [[1.0, 4.0, 0.0031308]]], np.float32)
    curve = encoded("i_t", None, "", {"i_t": linear})["i_t"]  # type: ignore[arg-type]
    assert curve.ravel()[:4] == pytest.approx([0, 0.01292, 0.735357, 1], abs=1e-6) and curve[1, 0, 1] > 1


def test_masks_move_to_the_right_and_nothing_comes_round() -> None:
    layer = np.zeros((2, 20, 1), np.float32)
    layer[0, 3], layer[1, 15] = 1, 1
    assert np.argwhere(moved(layer)[..., 0]).tolist() == [[0, 3 + SHIFT]]


def test_the_command_line_says_what_it_wrote_or_why_not(dataset: Path, tmp_path: Path,
                                                        capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(dataset), str(tmp_path / "out"), "swap_d_r"]) == 0
    assert "5 examples, swap_d_r" in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "dataset.json").read_bytes())["totals"]["examples"] == 5
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").write_text("x")
    assert main([str(dataset), str(tmp_path / "other"), "swap_d_r"]) == 2
    assert main([str(tmp_path / "nothing"), str(tmp_path / "out2"), "swap_d_r"]) == 2
    assert "expected a finished dataset" in capsys.readouterr().err
