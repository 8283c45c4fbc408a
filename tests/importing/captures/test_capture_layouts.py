"""Layouts as other programs and people leave them: nested folders, empty lines, paths of Windows, angles of frames."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.importing.captures.find_capture import read_capture
from tests.capture_files import Made, orbit

MADE = Made(size=(24, 16), focal=30.0)


def test_an_angle_of_a_frame_goes_before_a_length_of_all(tmp_path: Path) -> None:
    def change(document: dict) -> None:
        document["frames"][1] |= {"camera_angle_x": 2 * np.arctan(12 / 50), "camera_angle_y": 2 * np.arctan(8 / 50)}

    replace(MADE, poses=orbit(2)).write_transforms(tmp_path / "a", images=False, change=change)
    first, second = read_capture(tmp_path / "a").shots
    assert first.lens.focal == (30.0, 30.0) and second.lens.focal == pytest.approx((50.0, 50.0))


@pytest.mark.parametrize(("images", "masks"), [("images/cam1", "masks/cam1"), ("images_4", "masks"),
                                               ("images_4", "masks_4"), ("images/cam1", "masks"), ("train", "masks")])
def test_masks_are_found_however_images_are_nested(images: str, masks: str, tmp_path: Path) -> None:
    made = replace(MADE, poses=orbit(2))
    made.write_images(tmp_path / images, tmp_path / masks)

    def change(document: dict) -> None:
        for frame in document["frames"]:
            frame["file_path"] = frame["file_path"].replace("images", images)

    made.write_transforms(tmp_path, images=False, change=change)
    assert [shot.mask for shot in read_capture(tmp_path).shots] == [
        tmp_path / masks / "view_000.png", tmp_path / masks / "view_001.png"]


def test_paths_as_windows_writes_them(tmp_path: Path) -> None:
    def change(document: dict) -> None:
        for frame in document["frames"]:
            frame["file_path"] = frame["file_path"].replace("/", "\\")

    replace(MADE, poses=orbit(2)).write_transforms(tmp_path / "a", change=change)
    assert read_capture(tmp_path / "a").shots[1].image == tmp_path / "a" / "images" / "view_001.png"


def test_texts_of_colmap_with_and_without_empty_lines(tmp_path: Path) -> None:
    """Without a line for the points of each image, every other image would be lost."""
    folder = replace(MADE, poses=orbit(4)).write_colmap(tmp_path / "a", binary=False)
    path = folder / "sparse" / "0" / "images.txt"
    text = path.read_text()
    path.write_text(text + "\n\n")
    assert len(read_capture(folder).shots) == 4
    path.write_text("".join(f"{line}\n" for line in text.splitlines() if line and not line.endswith("-1")))
    with pytest.raises(UserError, match=r"expected the points of image view_000.png.*put an empty line after each"):
        read_capture(folder)
    path.write_text(text)
    cameras = folder / "sparse" / "0" / "cameras.txt"
    cameras.write_text("\ufeff" + cameras.read_text().removeprefix("# cameras\n"))
    assert len(read_capture(folder).shots) == 4


@pytest.mark.parametrize(("options", "rule"), [({"images": "images_4"}, "--images: expected a COLMAP model"),
                                               ({"frame": 3}, "--frame: expected a rig")])
def test_options_of_another_layout_are_refused(tmp_path: Path, options: dict, rule: str) -> None:
    replace(MADE, poses=orbit(2)).write_transforms(tmp_path, images=False)
    with pytest.raises(UserError, match=rule):
        read_capture(tmp_path, **options)
