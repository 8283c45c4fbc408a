"""Checks of captures: what is right passes, every planted fault is named with its figure and remedy."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from dataset_builder.importing.captures.photo_checks import gains
from dataset_builder.importing.captures.pose_checks import camera_notes
from dataset_builder.importing.captures.silhouettes import few_of
from tests.capture_files import BALL, BOX, MIDDLE, RADIUS, Made, orbit, tilted
from tests.capture_review import MADE, refused, review


def test_a_good_capture_passes_without_a_note(good: Path, tmp_path: Path) -> None:
    found = review(good, tmp_path)
    assert found.iou > 0.95 and found.notes == () and found.masked and found.kept == tuple(range(24))
    assert np.array_equal(found.gains, np.ones(24))
    draws = np.random.default_rng(0).normal(size=(500, 3))
    ball = BALL + RADIUS * draws / np.linalg.norm(draws, axis=1, keepdims=True)
    corners = np.array([[x, y, z] for x in BOX[:, 0] for y in BOX[:, 1] for z in BOX[:, 2]])
    reach = np.linalg.norm(3 * np.concatenate([corners, ball]) @ tilted().T - found.ball.centre, axis=1)
    assert 0.85 * found.ball.radius < reach.max() <= 1.01 * found.ball.radius


def test_alpha_serves_as_masks_do(good: Path, tmp_path: Path) -> None:
    MADE.write_transforms(tmp_path / "alpha", masks=False, alpha=True)
    one, other = review(good, tmp_path / "one").roll.images, review(tmp_path / "alpha", tmp_path / "two").roll.images
    assert np.abs(one.pixels[..., 3].astype(float) - other.pixels[..., 3]).max() < 0.01
    whole = one.pixels[..., 3] > 0.999
    assert np.abs(one.pixels.astype(float) - other.pixels)[whole].max() < 0.01


@pytest.mark.parametrize("bend", [(0.0, 0.0, 0.0, 0.0), (-0.15, 0.03, 0.004, -0.003), (0.12, 0.0, 0.0, 0.0)])
def test_lenses_are_undone(bend: tuple[float, float, float, float], tmp_path: Path) -> None:
    """Pixels are those of a pinhole camera with the pose, focal lengths and centre that are told."""
    made = Made(poses=orbit(8), size=(120, 90), focal=150.0, bend=bend)
    images = review(made.write_transforms(tmp_path / "a"), tmp_path / "work", size=60).roll.images
    assert images.pixels.shape == (8, 45, 60, 4) and images.pixels.dtype == np.float16
    for number in (0, 3):
        pinhole = Made(poses=made.poses[number:number + 1], size=(60, 45), focal=float(images.focal[number, 0]))
        assert images.focal[number, 0] == pytest.approx(images.focal[number, 1])
        shift = images.centre[number] - [30, 22.5]
        truth = _pinhole_image(pinhole, shift)
        inside = truth[..., 3] > 0.999
        apart = (images.pixels[number].astype(float) - truth)
        assert np.sqrt(np.mean(apart[inside][:, :3] ** 2)) < 0.009
        assert np.abs(apart[..., 3]).mean() < 0.01 and 0.1 < inside.mean() < 0.6


def _pinhole_image(made: Made, shift: np.ndarray) -> np.ndarray:
    """The image with its centre moved: what is seen through a lens whose direct way is bent by nothing."""
    class Moved(Made):
        def bent(self, ways: np.ndarray) -> np.ndarray:
            return super().bent(ways) + shift

    moved = Moved(poses=made.poses, size=made.size, focal=made.focal, bend=(1e-12, 0.0, 0.0, 0.0))
    return moved.image(0, over=4)


def test_all_faults_of_cameras_and_files_are_told_at_once(copied: Path, tmp_path: Path) -> None:
    document = json.loads((copied / "transforms.json").read_text())
    frames = document["frames"]
    frames[0]["transform_matrix"][1][1] = float("nan")
    frames[1]["transform_matrix"] = (np.array(frames[1]["transform_matrix"]) @ np.diag([-1, 1, 1, 1.0])).tolist()
    frames[2]["transform_matrix"] = (np.array(frames[2]["transform_matrix"]) @ np.diag([2, 2, 2, 1.0])).tolist()
    frames[9]["fl_x"] = -1.0
    frames[10] = frames[11]
    (copied / "transforms.json").write_text(json.dumps(document))
    (copied / "images" / "view_003.png").unlink()
    (copied / "images" / "view_004.png").write_bytes((copied / "images" / "view_004.png").read_bytes()[:40])
    Image.new("RGB", (40, 64)).save(copied / "images" / "view_005.png")
    Image.new("L", (32, 32)).save(copied / "masks" / "view_006.png")
    (copied / "masks" / "view_007.png").unlink()
    said = refused(copied, tmp_path / "work").splitlines()
    for name, rule in (("view_000.png: camera", "expected finite numbers, got NaN"),
                       ("view_001.png: camera", "got -1.0000: a mirrored camera"),
                       ("view_002.png: camera", "got 8.0000"), ("images/view_003.png", "found none (put it back"),
                       ("images/view_004.png", "expected a readable image"),
                       ("images/view_005.png", "expected an image of the calibration's shape, 64 x 64, got 40 x 64"),
                       ("masks/view_006.png", "expected a mask of the image's size, 64 x 64, got 32 x 32"),
                       ("masks/view_007.png", "found none (put it back"),
                       ("view_009.png: camera", "focal lengths above 0, got -1"),
                       ("images/view_011.png", "got two poses of this one")):
        assert any(name in line and rule in line for line in said), (name, rule, said)
    assert "10 of 24 images cannot be used (mend them, or leave them out with --skip-bad)" in said[-1]
    kept = review(copied, tmp_path / "work", skip=True)
    assert len(kept.capture.shots) == 14 and kept.iou > 0.9
    assert kept.notes[0].startswith("10 images left out that cannot be used: images/view_000.png,")


def test_an_image_turned_after_calibration_is_told(tmp_path: Path) -> None:
    made = Made(size=(64, 48), poses=orbit(8))
    made.write_transforms(tmp_path / "a")
    path = tmp_path / "a" / "images" / "view_002.png"
    Image.open(path).transpose(Image.Transpose.ROTATE_90).save(path)
    assert "got 48 x 64 (it was turned after calibration; turn it back)" in refused(tmp_path / "a", tmp_path / "work")


def test_empty_and_full_masks_are_told(copied: Path, tmp_path: Path) -> None:
    for index, value in ((2, 0), (5, 255)):
        Image.new("L", (64, 64), value).save(copied / "masks" / f"view_{index:03d}.png")
    said = refused(copied, tmp_path / "work").splitlines()
    assert "view_002.png: expected a mask of 1% to 90% of the frame, got 0.0%" in said[0]
    assert "view_005.png: expected a mask of 1% to 90% of the frame, got 100.0%" in said[1]
    assert set(range(24)) - set(review(copied, tmp_path / "work", skip=True).kept) == {2, 5}


def test_images_that_end_too_soon_are_told_together(copied: Path, tmp_path: Path) -> None:
    """Their headers are whole, so that only decoding shows it."""
    for index in (3, 8):
        path = copied / "images" / f"view_{index:03d}.png"
        path.write_bytes(path.read_bytes()[:-400])
    said = refused(copied, tmp_path / "work").splitlines()
    assert len(said) == 3 and all("view_00" in line and "expected a readable image" in line for line in said[:2])
    found = review(copied, tmp_path / "work", skip=True)
    assert set(range(24)) - set(found.kept) == {3, 8} and found.iou > 0.95


def test_five_images_are_too_few_and_ten_are_few(tmp_path: Path) -> None:
    Made(poses=orbit(5)).write_transforms(tmp_path / "a")
    assert "expected at least 8 usable images, got 5" in refused(tmp_path / "a", tmp_path / "work")
    found = review(Made(poses=orbit(10)).write_transforms(tmp_path / "b"), tmp_path / "work")
    notes = camera_notes(found.capture, MIDDLE, np.array([0, 0, 1.0]))
    assert notes == ["10 images; below 20 a field guesses much"]


def test_masks_for_some_images_only_are_told(tmp_path: Path) -> None:
    Made(poses=orbit(8)).write_transforms(tmp_path / "a", masks=False, alpha=True)
    path = tmp_path / "a" / "images" / "view_003.png"
    Image.open(path).convert("RGB").save(path)
    assert "got none for 1: images/view_003.png" in refused(tmp_path / "a", tmp_path / "work")


def test_exposures_are_evened_and_blurred_images_dropped(tmp_path: Path) -> None:
    """A telephone's: gains of e^0.25 rms, known here, and two blurred images. Measured: the worst gain is 5% off."""
    drawn = np.exp(np.random.default_rng(0).normal(0, 0.25, 24))

    def shown(index: int, rgba: np.ndarray) -> np.ndarray:
        colour, cover = rgba[..., :3] * drawn[index], rgba[..., 3:]
        if index in (3, 11):
            colour = gaussian_filter(colour, (2.5, 2.5, 0)) * cover
        return np.concatenate([colour, cover], axis=-1)

    made = Made(size=(96, 96), focal=140.0, shown=shown)
    found = review(made.write_transforms(tmp_path / "a"), tmp_path / "work")
    apart = np.log(found.gains / drawn)
    assert np.abs(apart - np.median(apart)).max() < 0.1
    assert set(range(24)) - set(found.kept) == {3, 11}
    blurred, exposed = found.notes
    assert blurred == "2 blurred images left out: images/view_003.png, images/view_011.png"
    assert "(expected 0.8 to 1.25): all were evened" in exposed


def test_even_exposures_are_measured_even(good: Path, tmp_path: Path) -> None:
    """Measured: 0.97 to 1.01."""
    found = review(good, tmp_path)
    measured = gains(found.roll.images, found.ball, few_of(found.roll.images, range(24)))
    assert np.abs(np.log(measured)).max() < 0.06
