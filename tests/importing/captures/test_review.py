"""Checks of captures: what is right passes, every planted fault is named with its figure and remedy."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from dataset_builder.errors import UserError
from dataset_builder.importing.captures.find_capture import read_capture
from dataset_builder.importing.captures.photo_checks import gains
from dataset_builder.importing.captures.photographs import Ball, boxed
from dataset_builder.importing.captures.pose_checks import camera_notes, widest_gap
from dataset_builder.importing.captures.review import Reviewed, focus_ball, reviewed
from dataset_builder.importing.captures.silhouettes import few_of
from tests.capture_files import BALL, BOX, FLIP, MIDDLE, RADIUS, Made, orbit, tilted

MADE = Made(turn=tilted(), scale=3.0)


def review(folder: Path, work: Path, **options: object) -> Reviewed:
    return reviewed(read_capture(folder), folder.name, **{  # type: ignore[arg-type]
        "size": 64, "ball": None, "skip": False, "work": work, **options})


def refused(folder: Path, work: Path, **options: object) -> str:
    with pytest.raises(UserError) as caught:
        review(folder, work, **options)
    return str(caught.value)


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture with masks in a folder of their own; not to be changed."""
    return MADE.write_transforms(tmp_path_factory.mktemp("good") / "good")


@pytest.fixture
def copied(good: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    folder = tmp_path / "copied"
    for path in sorted(good.rglob("*")):
        if path.is_file():
            (folder / path.relative_to(good)).parent.mkdir(parents=True, exist_ok=True)
            (folder / path.relative_to(good)).write_bytes(path.read_bytes())
    return folder


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


def with_matrices(folder: Path, matrices: np.ndarray) -> None:
    """Other matrices in `transforms.json`, which wants OpenGL's camera-to-world."""
    document = json.loads((folder / "transforms.json").read_text())
    for frame, matrix in zip(document["frames"], matrices.tolist(), strict=True):
        frame["transform_matrix"] = matrix
    (folder / "transforms.json").write_text(json.dumps(document))


@pytest.mark.parametrize(("given", "kind"), [
    (lambda poses: poses, "camera-to-world with OpenCV"),
    (lambda poses: np.linalg.inv(poses @ FLIP), "world-to-camera with OpenGL"),
    (lambda poses: np.linalg.inv(poses), "world-to-camera with OpenCV"),
])
def test_wrong_conventions_are_named(given: Callable[[np.ndarray], np.ndarray], kind: str, copied: Path,
                                     tmp_path: Path) -> None:
    with_matrices(copied, given(MADE.told))
    said = refused(copied, tmp_path / "work")
    assert f"the matrices are {kind}'s axes, where transforms.json has camera-to-world with OpenGL's axes" in said
    assert "with that it is 0.9" in said


@pytest.mark.parametrize(("given", "kind"), [
    (lambda poses: poses, "camera-to-world with OpenCV"), (lambda poses: poses @ FLIP, "camera-to-world with OpenGL"),
    (lambda poses: np.linalg.inv(poses @ FLIP), "world-to-camera with OpenGL")])
def test_wrong_conventions_of_colmap_are_named(given: Callable[[np.ndarray], np.ndarray], kind: str, good: Path,
                                               tmp_path: Path) -> None:
    folder = MADE.write_colmap(tmp_path / "a", given=given(MADE.told), shots=False)
    for name in ("images", "masks"):
        (folder / name).symlink_to(good / name)
    said = refused(folder, tmp_path / "work")
    assert f"the matrices are {kind}'s axes, where COLMAP has world-to-camera with OpenCV's axes" in said
    assert "with that it is 0.9" in said


def test_images_mirrored_after_calibration_are_named(copied: Path, tmp_path: Path) -> None:
    for path in [*(copied / "images").iterdir(), *(copied / "masks").iterdir()]:
        Image.open(path).transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(path)
    assert "mirror the images left to right" in refused(copied, tmp_path / "work")


def test_inverted_masks_are_named(copied: Path, tmp_path: Path) -> None:
    for path in (copied / "masks").iterdir():
        Image.fromarray(255 - np.asarray(Image.open(path))).save(path)
    assert "invert the masks: white is to be the object" in refused(copied, tmp_path / "work")


def test_masks_of_other_images_are_told(copied: Path, tmp_path: Path) -> None:
    paths = sorted((copied / "masks").iterdir())
    contents = [path.read_bytes() for path in paths]
    for index, path in enumerate(paths):
        path.write_bytes(contents[(7 * index + 5) % 24])
    assert "expected cameras and masks that agree" in refused(copied, tmp_path / "work")


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


def test_without_masks_a_ball_is_found_or_taken(tmp_path: Path) -> None:
    MADE.write_transforms(tmp_path / "a", masks=False)
    found = review(tmp_path / "a", tmp_path / "one")
    assert not found.masked and "background, which was not removed" in found.notes[0]
    assert np.linalg.norm(found.ball.centre - 3 * tilted() @ MIDDLE) < 1e-6
    assert found.ball.radius == pytest.approx(0.35 * 6)
    given = Ball(centre=tuple((3 * tilted() @ MIDDLE).tolist()), radius=1.5)  # type: ignore[arg-type]
    taken = review(tmp_path / "a", tmp_path / "two", ball=given)
    # A ball of radius r at distance d covers a disc of radius f r / sqrt(d^2 - r^2) about the middle
    disc = 96 * 1.5 / np.sqrt(6**2 - 1.5**2)
    assert taken.roll.share == pytest.approx(np.pi * disc**2 / 64**2, abs=0.01)
    middle, half = np.array(given.centre), 0.6
    box = boxed([*(middle - half), *(middle + half)])
    assert box.centre == pytest.approx(given.centre) and box.radius == pytest.approx(half * 3**0.5)
    # Between the discs of the balls within and about it
    low, high = (np.pi * (96 * r / np.sqrt(6**2 - r**2)) ** 2 / 64**2 for r in (half, half * 3**0.5))
    share = review(tmp_path / "a", tmp_path / "three", ball=box).roll.share
    assert (share > low).all() and (share < high).all()


@pytest.mark.parametrize(("given", "kind"), [
    (lambda poses: poses, "camera-to-world with OpenCV"), (np.linalg.inv, "world-to-camera with OpenCV"),
    (lambda poses: np.linalg.inv(poses @ FLIP), "world-to-camera with OpenGL")])
def test_wrong_conventions_are_named_without_masks(given: Callable[[np.ndarray], np.ndarray], kind: str, copied: Path,
                                                   tmp_path: Path) -> None:
    """By colours that meet nowhere. Measured: 0.53 of the difference by chance as it should be, 1.00 otherwise."""
    shutil.rmtree(copied / "masks")
    assert len(review(copied, tmp_path / "right").notes) == 1
    with_matrices(copied, given(MADE.told))
    said = refused(copied, tmp_path / "work")
    assert f"the matrices are {kind}'s axes, where transforms.json has" in said and "with that it is 0.5" in said


def test_cameras_that_look_outwards_are_refused(tmp_path: Path) -> None:
    """A room seen from its middle: every camera sees something else."""
    draws = np.random.default_rng(0)
    made = replace(MADE, poses=orbit(10), shown=lambda index, rgba: np.concatenate([
        draws.uniform(0, 0.8, (*rgba.shape[:2], 3)), np.ones_like(rgba[..., :1])], axis=-1))
    with_matrices(made.write_transforms(tmp_path / "a", masks=False), made.told @ np.diag([-1.0, 1, -1, 1]) @ FLIP)
    said = refused(tmp_path / "a", tmp_path / "work")
    assert "10 of 10 that look away" in said and "not contracted" in said
    with pytest.raises(UserError, match="look away"):
        focus_ball(read_capture(tmp_path / "a"), "a")


def test_the_widest_gap_is_measured() -> None:
    up = np.array([0.0, 0.6, 0.8])
    turn = np.stack([np.array([1.0, 0, 0]), np.cross(up, [1.0, 0, 0]), up])
    angles = np.radians([0, 30, 100, 200])
    offsets = np.stack([np.cos(angles), np.sin(angles), [3.0, 1, 2, 0]], axis=1) @ turn
    assert widest_gap(offsets, up) == pytest.approx(160)
    capture = read_capture_of(offsets)
    assert "160 degrees around the object have no camera" in camera_notes(capture, np.zeros(3), up)[1]


def read_capture_of(places: np.ndarray) -> object:
    from dataset_builder.importing.captures.capture import Capture, CaptureShot, Lens, rigid

    lens = Lens(size=(8, 8), focal=(8.0, 8.0), centre=(4.0, 4.0))
    return Capture(layout="COLMAP", shots=tuple(
        CaptureShot(name=str(index), image=Path(str(index)), mask=None, lens=lens, pose=rigid(np.eye(3), place))
        for index, place in enumerate(places)))


