"""What images themselves say against their calibration, their masks and each other."""

from pathlib import Path

import pytest
from PIL import Image

from dataset_builder.errors import UserError
from dataset_builder.importing.captures.find_capture import read_capture
from dataset_builder.importing.captures.photographs import Ball
from dataset_builder.importing.captures.review import Reviewed, reviewed
from tests.capture_files import MIDDLE, Made, orbit

AROUND = Ball(centre=(float(MIDDLE[0]), float(MIDDLE[1]), float(MIDDLE[2])), radius=0.6)


def review(folder: Path, ball: Ball | None = None) -> Reviewed:
    return reviewed(read_capture(folder), folder.name, size=48, ball=ball, skip=False, work=folder.parent / "work")


@pytest.mark.parametrize("ball", [None, AROUND])
def test_alpha_that_is_opaque_everywhere_is_no_mask(ball: Ball | None, tmp_path: Path) -> None:
    """As telephones save screens. Taken for masks, the ball itself would be the object, and `masked` be told."""
    Made(poses=orbit(10)).write_transforms(tmp_path / "a", masks=False)
    for path in (tmp_path / "a" / "images").iterdir():
        Image.open(path).convert("RGBA").save(path)
    found = review(tmp_path / "a", ball)
    assert not found.masked and any("its background, which was not removed" in note for note in found.notes)


def test_a_ball_beside_masks_is_told_to_be_unused(tmp_path: Path) -> None:
    Made(poses=orbit(10)).write_transforms(tmp_path / "a")
    found = review(tmp_path / "a", AROUND)
    assert found.masked and found.notes == ("the ball or box that is given is not used: what the masks show is taken",)


def test_a_ball_that_no_image_sees_is_refused(tmp_path: Path) -> None:
    Made(poses=orbit(10)).write_transforms(tmp_path / "a", masks=False)
    with pytest.raises(UserError, match=r"sees nothing of the ball or box \(give another --ball"):
        review(tmp_path / "a", Ball(centre=(50, 0, 0), radius=0.6))


def test_images_without_a_size_are_told(tmp_path: Path) -> None:
    folder = Made(poses=orbit(8)).write_colmap(tmp_path / "a", binary=False)
    cameras = folder / "sparse" / "0" / "cameras.txt"
    cameras.write_text(cameras.read_text().replace("OPENCV 64 64", "OPENCV 0 0"))
    with pytest.raises(UserError, match=r"view_000\.png: camera: expected an image size above 0, got 0 x 0"):
        review(folder)


def test_a_photograph_that_is_there_twice_is_told(tmp_path: Path) -> None:
    Made(poses=orbit(10)).write_transforms(tmp_path / "a", masks=False, alpha=True)
    images = tmp_path / "a" / "images"
    (images / "view_004.png").unlink()
    (images / "view_004.png").symlink_to(images / "view_003.png")
    with_copy = ""
    try:
        with_copy = " ".join(review(tmp_path / "a").notes)
    except UserError as error:
        pytest.fail(str(error))
    assert "1 images are copies of others, byte for byte: images/view_004.png and images/view_003.png" in with_copy
