"""The strip and the animation have the views in order, at one exposure."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from PIL import Image

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.label.sequence_plan import SequencePlan
from dataset_builder.report.example_sheet import LABEL_WIDTH, MARGIN
from dataset_builder.report.sequence_preview import CELL, LARGEST, places, small, write_preview
from dataset_builder.shards.reader import Dataset, open_dataset
from dataset_builder.tonemap import exposure, to_8bit
from tests.lightnet.synthetic import write_synthetic
from tests.lightnet.turning_set import write_turning
from tests.plans import example_plan

FRAMES, SIZE = 12, 32


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One view of the first of two sequences is missing; previews are written into it."""
    return write_turning(tmp_path_factory.mktemp("turning") / "turning", frames=FRAMES, sequences=2, missing=(3,),
                         size=SIZE, gloss=0.3, step=20.0)


def test_an_animation_has_every_view_in_order_at_one_exposure(folder: Path,
                                                              capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", str(folder), "--sequence", "turn-00-00"]) == 0
    assert "animation of 11 views: " in capsys.readouterr().out
    dataset = open_dataset(folder)
    keys = dataset.splits["turn"][:FRAMES - 1]
    lit = exposure(dataset[key][layer] for key in keys for layer in ("i_t", "s_prime"))
    plain = exposure(dataset[key]["i_s"] for key in keys)
    with Image.open(folder / "previews/turn-00-00.png") as animation:
        assert (animation.n_frames, animation.size) == (FRAMES - 1, (3 * SIZE, SIZE))
        for number, key in enumerate(keys):
            animation.seek(number)
            wanted = [to_8bit(dataset[key][layer], factor) for layer, factor in (("i_s", plain), ("s_prime", lit),
                                                                                ("i_t", lit))]
            assert np.array_equal(np.asarray(animation.convert("RGB")), np.concatenate(wanted, axis=1))


def test_a_strip_has_ten_of_them(folder: Path, tmp_path: Path) -> None:
    found = write_preview(folder, "turn-01-00-0-0", tmp_path)
    assert found.views == FRAMES
    with Image.open(found.strip) as strip:
        assert strip.width >= MARGIN + LABEL_WIDTH + 10 * CELL and strip.height > 3 * CELL


def test_a_name_alone_takes_the_first_light_and_level(tmp_path: Path) -> None:
    def label(key: str) -> SimpleNamespace:
        frame, level = divmod(int(key), 2)
        plan = example_plan(int(key))
        return SimpleNamespace(plan=plan.model_copy(update={
            "rough": plan.rough.model_copy(update={"level": level}),
            "sequence": SequencePlan(name="turn-00-00", frame=frame, frames=3)}))

    dataset = cast(Dataset, SimpleNamespace(splits={"turn": [str(number) for number in range(6)]}, label=label))
    assert places(dataset, tmp_path, "turn-00-00") == {0: "0", 1: "2", 2: "4"}
    assert places(dataset, tmp_path, f"turn-00-00-{example_plan().light}-1") == {0: "1", 1: "3", 2: "5"}


def test_large_frames_are_made_smaller() -> None:
    checks = np.tile(np.array([[0, 200], [200, 0]], np.uint8), (256, 128))[..., None].repeat(3, axis=2)
    assert np.array_equal(small(checks), np.full((LARGEST, LARGEST // 2, 3), 100))
    assert small(checks[:200, :100]) is not None and small(checks[:200, :100]).shape == (200, 100, 3)


def test_what_is_no_sequence_is_refused_with_those_that_are(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"expected a sequence, got 'turn-07-00'; there are turn-00-00, turn-01-00$"):
        write_preview(folder, "turn-07-00")
    plain = write_synthetic(tmp_path / "plain", train=1, held_out=1, size=24)
    with pytest.raises(UserError, match="expected a sequence, got 'turn-00-00'; there are none"):
        write_preview(plain, "turn-00-00")
