"""Pixels of captures in files: memory that does not grow with them, and work that is taken up."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dataset_builder.assets.pose_readers.capture import Capture, CaptureShot, Lens
from dataset_builder.importing.captures import darkroom
from dataset_builder.importing.captures.darkroom import developed, parted
from dataset_builder.importing.captures.photo_checks import blurred
from dataset_builder.importing.captures.photographs import Photograph, frame_size, photograph
from tests.capture_files import orbit

LENS = Lens(size=(16, 16), focal=(16.0, 16.0), centre=(8.0, 8.0))


def shots(folder: Path, count: int) -> Capture:
    """So many poses of one image."""
    rgba = np.zeros((16, 16, 4), np.uint8)
    rgba[4:12, 4:12] = 188, 188, 188, 255
    Image.fromarray(rgba).save(folder / "a.png")
    return Capture(layout="COLMAP", shots=tuple(
        CaptureShot(name=str(index), image=folder / "a.png", mask=None, lens=LENS, pose=pose)
        for index, pose in enumerate(orbit(count))))


def test_ten_thousand_images_take_a_bounded_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """82 MB of pixels, in a file each time; what is held grows by figures of each image alone (27 MB measured). Reading
    of files is left out: it is one image at a time by itself."""
    capture = shots(tmp_path, 10_000)

    def made(shot: CaptureShot, size: tuple[int, int], ball: object) -> Photograph:
        pixels = np.full((size[1], size[0], 4), (int(shot.name) % 64) / 64, np.float32)
        return Photograph(pixels=pixels, focal=(1.0, 1.0), centre=(0.0, 0.0), share=0.5, sha256="0" * 64)

    monkeypatch.setattr(darkroom, "photograph", made)
    monkeypatch.setattr(darkroom, "sharpness", lambda pixels: 1.0)
    monkeypatch.setattr(darkroom, "median_luminance", lambda pixels: 0.5)
    tracemalloc.start()
    try:
        roll = developed(capture, 32, None, tmp_path / "work")
        gains = np.full(10_000, 0.5)
        fitted, held = parted(roll, range(10_000), gains, tmp_path / "work")
        assert tracemalloc.get_traced_memory()[1] < 40e6 < roll.images.pixels.nbytes
    finally:
        tracemalloc.stop()
    assert (len(fitted.pixels), len(held.pixels)) == (8750, 1250) and isinstance(fitted.pixels, np.memmap)
    assert held.names[:2] == ("4", "12")
    assert np.array_equal(held.pixels[1, 0, 0], np.float16([24 / 64, 24 / 64, 24 / 64, 12 / 64]))


def test_an_interrupted_call_is_taken_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    capture, taken = shots(tmp_path, 100), list[str]()

    def counted(shot: CaptureShot, size: tuple[int, int], ball: None) -> Photograph:
        if len(taken) == 80:
            raise KeyboardInterrupt
        taken.append(shot.name)
        return photograph(shot, size, ball)

    monkeypatch.setattr(darkroom, "photograph", counted)
    with pytest.raises(KeyboardInterrupt):
        developed(capture, 16, None, tmp_path / "work")
    taken.clear()
    found = developed(capture, 16, None, tmp_path / "work")
    assert taken == [str(index) for index in range(64, 100)]
    monkeypatch.undo()
    other = developed(capture, 16, None, tmp_path / "other")
    assert np.array_equal(found.images.pixels, other.images.pixels) and found.seals == other.seals
    assert np.array_equal(found.images.focal, other.images.focal) and np.array_equal(found.share, other.share)


def test_other_files_or_settings_begin_anew(tmp_path: Path) -> None:
    capture = shots(tmp_path, 9)
    first = developed(capture, 16, None, tmp_path / "work")
    Image.new("RGBA", (16, 16), (255, 0, 0, 255)).save(tmp_path / "a.png")
    second = developed(capture, 16, None, tmp_path / "work")
    assert first.seals != second.seals and (second.images.pixels[..., 0] == 1).all()
    assert developed(capture, 8, None, tmp_path / "work").images.pixels.shape == (9, 8, 8, 4)


def test_srgb_is_undone_and_opacity_multiplied(tmp_path: Path) -> None:
    """IEC 61966-2-1: 188 / 255 is 0.5029 of white."""
    taken = photograph(shots(tmp_path, 1).shots[0], (16, 16), None)
    inside = taken.pixels[..., 3] > 0.999
    assert np.allclose(taken.pixels[inside][:, :3], ((188 / 255 + 0.055) / 1.055) ** 2.4, atol=1e-4)
    assert (taken.pixels[..., :3] <= taken.pixels[..., 3:] * 0.51).all() and taken.share == 0.25


def test_working_images_have_the_shape_of_the_photographs() -> None:
    assert frame_size([(4000, 3000)], 256) == (256, 192)
    assert frame_size([(3000, 4000), (1500, 2000)], 256) == (192, 256)
    assert frame_size([(4000, 3000), (3000, 4000)], 256) == (256, 256)


def test_few_are_held_out_of_many_and_none_of_few(tmp_path: Path) -> None:
    roll = developed(shots(tmp_path, 20), 16, None, tmp_path / "work")
    for kept, held in ((20, 2), (16, 2), (15, 0)):
        one, other = parted(roll, range(kept), np.ones(20), tmp_path / "work")
        assert (len(one.pixels), len(other.pixels)) == (kept - held, held)


def test_blur_is_seen_beside_neighbours_alone() -> None:
    """A plain side has little detail in all of its images."""
    poses = orbit(40)
    sharp = 1 + 0.9 * np.cos(2 * np.pi * np.arange(40) / 40)
    assert blurred(sharp, poses, np.zeros(3)) == []
    sharp[[5, 30]] *= 0.2
    assert blurred(sharp, poses, np.zeros(3)) == [5, 30]
    assert len(blurred(np.where(np.arange(40) % 2, 0.01, 1.0), poses, np.zeros(3))) <= 8
