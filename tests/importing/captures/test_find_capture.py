"""Every layout gives the same cameras; damage in any is told."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.importing.captures.find_capture import read_capture
from tests.capture_files import FLIP, Made, orbit, tilted

MADE = Made(poses=orbit(10), size=(24, 16), focal=30.0, turn=tilted(), scale=3.0, bend=(-0.1, 0.02, 0.002, -0.001))
POINTS = np.arange(12.0).reshape(4, 3)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("layouts")
    MADE.write_transforms(root / "transforms")
    MADE.write_colmap(root / "binary", points=POINTS)
    MADE.write_colmap(root / "text", binary=False, points=POINTS)
    replace(MADE, bend=(0, 0, 0, 0)).write_actors_hq(root / "rig", frame=7)
    return root


@pytest.mark.parametrize(("folder", "layout"), [("transforms", "transforms.json"), ("binary", "COLMAP"),
                                                ("text", "COLMAP"), ("rig", "ActorsHQ")])
def test_all_layouts_give_the_same_cameras(written: Path, folder: str, layout: str) -> None:
    found = read_capture(written / folder, frame=7 if folder == "rig" else 0)
    assert found.layout == layout and found.metric == (folder == "rig")
    assert np.abs(np.stack([shot.pose for shot in found.shots]) - MADE.told).max() < 1e-12
    lens = found.shots[3].lens
    assert (lens.size, lens.centre) == ((24, 16), (12.0, 8.0)) and np.allclose(lens.focal, 30.0)
    assert lens.bend == ((0, 0, 0, 0) if folder == "rig" else MADE.bend)
    for shot in found.shots:
        assert shot.image.is_file() and shot.mask is not None and shot.mask.is_file()
    if layout == "COLMAP":
        assert found.points == {index + 1: tuple(point) for index, point in enumerate(POINTS.tolist())}


@pytest.mark.parametrize(("model", "bend"), [("SIMPLE_PINHOLE", (0, 0, 0, 0)), ("PINHOLE", (0, 0, 0, 0)),
                                             ("SIMPLE_RADIAL", (-0.1, 0, 0, 0)), ("RADIAL", (-0.1, 0.02, 0, 0)),
                                             ("OPENCV", MADE.bend)])
def test_every_lens_of_colmap_that_is_read(tmp_path: Path, model: str, bend: tuple[float, ...]) -> None:
    made = replace(MADE, poses=orbit(2))
    for binary in (True, False):
        folder = made.write_colmap(tmp_path / str(binary), binary=binary, model=model)
        lens = read_capture(folder).shots[0].lens
        assert (lens.focal, lens.centre, lens.bend) == ((30.0, 30.0), (12.0, 8.0), bend)


def test_quaternions_of_any_length(tmp_path: Path) -> None:
    """Doubled, they mean the same; of no length, the camera is no number and told with others, not the whole model."""
    path = replace(MADE, poses=orbit(3)).write_colmap(tmp_path, binary=False) / "sparse/0/images.txt"
    before = read_capture(tmp_path)
    lines = [line.split() for line in path.read_text().splitlines()]
    cameras = [line for line in lines if len(line) == 10 and line[0] != "#"]
    cameras[0][1:5] = [repr(2 * float(number)) for number in cameras[0][1:5]]
    cameras[1][1:5] = ["0"] * 4
    path.write_text("\n".join(map(" ".join, lines)) + "\n")
    poses = [shot.pose for shot in read_capture(tmp_path).shots]
    assert np.allclose(poses[0], before.shots[0].pose, atol=1e-12) and np.isnan(poses[1]).any()
    assert np.array_equal(poses[2], before.shots[2].pose)


@pytest.mark.parametrize("binary", [True, False])
def test_other_lenses_are_refused_by_name(tmp_path: Path, binary: bool) -> None:
    folder = replace(MADE, poses=orbit(2)).write_colmap(tmp_path / "a", binary=binary, model="OPENCV_FISHEYE")
    with pytest.raises(UserError, match=r"got OPENCV_FISHEYE .*colmap image_undistorter"):
        read_capture(folder)


def test_pixels_and_directions_are_inverse() -> None:
    lens = read_lens((-0.2, 0.05, 0.004, -0.003))
    pixels = np.stack(np.meshgrid(np.linspace(0, 24, 9), np.linspace(0, 16, 7)), axis=-1)
    assert np.abs(lens.pixels(lens.ways(pixels)) - pixels).max() < 1e-6
    assert np.allclose(lens.pixels(np.array([0.1, -0.2])), MADE_BENT)
    half = lens.scaled((12, 8))
    assert np.allclose(half.pixels(np.array([0.1, -0.2])), MADE_BENT / 2)


MADE_BENT = replace(MADE, bend=(-0.2, 0.05, 0.004, -0.003)).bent(np.array([0.1, -0.2]))


def read_lens(bend: tuple[float, float, float, float]) -> object:
    from dataset_builder.assets.pose_readers.capture import Lens

    return Lens(size=(24, 16), focal=(30.0, 30.0), centre=(12.0, 8.0), bend=bend)


def test_angles_and_names_without_endings_as_nerf_has_them(tmp_path: Path) -> None:
    def change(document: dict) -> None:
        for name in ("w", "h", "cx", "cy", "fl_x", "fl_y", "k1", "k2", "p1", "p2", "camera_model"):
            del document[name]
        document["camera_angle_x"] = 2 * np.arctan(24 / 2 / 30)
        for frame in document["frames"]:
            frame["file_path"] = f"./{frame['file_path'].removesuffix('.png')}"

    replace(MADE, poses=orbit(2)).write_transforms(tmp_path / "a", masks=False, alpha=True, change=change)
    (tmp_path / "a" / "transforms.json").rename(tmp_path / "a" / "transforms_train.json")
    shot = read_capture(tmp_path / "a").shots[1]
    assert np.allclose(shot.lens.focal, 30) and shot.lens.centre == (12, 8) and shot.mask is None
    assert shot.image == tmp_path / "a" / "images" / "view_001.png"


def test_what_nerfstudio_applied_is_undone(tmp_path: Path) -> None:
    applied = np.array([[0, 1.0, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]])

    def change(document: dict) -> None:
        document["applied_transform"] = applied.tolist()
        for frame, pose in zip(document["frames"], MADE.told, strict=True):
            frame["transform_matrix"] = (np.vstack([applied, [0, 0, 0, 1]]) @ pose @ FLIP).tolist()

    MADE.write_transforms(tmp_path / "a", change=change)
    poses = np.stack([shot.pose for shot in read_capture(tmp_path / "a").shots])
    assert np.abs(poses - MADE.told).max() < 1e-12


def test_frames_have_lenses_and_masks_of_their_own(tmp_path: Path) -> None:
    def change(document: dict) -> None:
        document["frames"][1] |= {"fl_x": 50.0, "mask_path": "masks/other.png"}

    replace(MADE, poses=orbit(2)).write_transforms(tmp_path / "a", change=change)
    first, second = read_capture(tmp_path / "a").shots
    assert (first.lens.focal, second.lens.focal) == ((30.0, 30.0), (50.0, 30.0))
    assert second.mask == tmp_path / "a" / "masks" / "other.png"


@pytest.mark.parametrize(("change", "rule"), [
    ({"camera_model": "OPENCV_FISHEYE"}, "got OPENCV_FISHEYE"), ({"k3": 0.1}, "without k3 and k4"),
    ({"is_fisheye": True}, "expected a camera model"), ({"frames": 3}, "frames: expected a list, got 3"),
    ({"frames": [{"file_path": "../../etc/passwd", "transform_matrix": np.eye(4).tolist()}]}, "expected the path of a"),
    ({"frames": [{"file_path": "/etc/passwd", "transform_matrix": np.eye(4).tolist()}]}, "expected the path of a"),
    ({"frames": [{"file_path": "a.png", "transform_matrix": [[1.0]]}]}, r"a matrix of shape \(1, 1\)"),
    ({"fl_x": None, "camera_angle_x": 56.1}, "camera_angle_x: expected an angle between 0 and pi radians, got 56.1"),
    ({"frames": []}, "expected photographs with poses, found none"), ({"fl_x": 0, "fl_y": 0}, "expected fl_x or"),
    ({"applied_transform": np.zeros((3, 4)).tolist()}, "Singular")])
def test_wrong_transforms_are_told(tmp_path: Path, change: dict, rule: str) -> None:
    replace(MADE, poses=orbit(2)).write_transforms(tmp_path / "a", images=False,
                                                   change=lambda document: document.update(change))
    with pytest.raises(UserError, match=rule):
        read_capture(tmp_path / "a")


def test_smaller_images_of_mip_nerf_360(tmp_path: Path) -> None:
    made = replace(MADE, poses=orbit(2))
    made.write_colmap(tmp_path / "a", masks=False)
    replace(made, size=(12, 8), focal=15.0).write_images(tmp_path / "a" / "images_2", tmp_path / "a" / "masks_2")
    found = read_capture(tmp_path / "a", images="images_2").shots[0]
    assert found.image == tmp_path / "a" / "images_2" / "view_000.png"
    assert found.mask == tmp_path / "a" / "masks_2" / "view_000.png"
    assert read_capture(tmp_path / "a").shots[0].mask is None


def test_what_is_no_capture_is_told(tmp_path: Path) -> None:
    for path, rule in ((tmp_path / "none", "found none"), (tmp_path / "film.mp4", "got a video.*ffmpeg -i"),
                       (tmp_path, r"expected poses \(.*colmap automatic_reconstructor")):
        with pytest.raises(UserError, match=rule):
            read_capture(path)
    (tmp_path / "rgbs").mkdir()
    for name in ("Cam001.mp4", "Cam002.mp4"):
        (tmp_path / "rgbs" / name).touch()
    (tmp_path / "calibration.csv").write_text("name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n" + "".join(
        f"{name},8,8,0,0,0,0,0,0,1,1,.5,.5\n" for name in ("Cam001", "Cam002")))
    with pytest.raises(UserError, match=r"got videos \(for every video: mkdir .*Cam001_rgb%06d.png"):
        read_capture(tmp_path)


def test_damaged_files_are_told(written: Path, tmp_path: Path) -> None:
    """Cut anywhere, or with any byte changed: read as something, or refused in words."""
    names = {"binary": ("cameras.bin", "images.bin", "points3D.bin"),
             "text": ("cameras.txt", "images.txt", "points3D.txt")}
    files = [(written / kind / "sparse" / "0" / name, tmp_path / kind / "sparse" / "0" / name)
             for kind, own in names.items() for name in own]
    files += [(written / "transforms" / "transforms.json", tmp_path / "transforms" / "transforms.json"),
              (written / "rig" / "calibration.csv", tmp_path / "rig" / "calibration.csv")]
    for source, target in files:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(source.read_bytes())
    draws, refused = np.random.default_rng(0), 0
    for source, target in files:
        whole = source.read_bytes()
        root = tmp_path / target.relative_to(tmp_path).parts[0]
        for trial in range(60):
            data = bytearray(whole[:int(draws.integers(len(whole)))] if trial % 3 == 0 else whole)
            for _ in range(0 if trial % 3 == 0 else 1 + trial % 4):
                data[int(draws.integers(len(data)))] = int(draws.integers(256))
            target.write_bytes(data)
            try:
                read_capture(root)
            except UserError as error:
                refused += 1
                assert str(error)
        target.write_bytes(whole)
    assert refused > 100


def test_a_count_beyond_the_file_is_told(written: Path, tmp_path: Path) -> None:
    sparse = tmp_path / "sparse" / "0"
    sparse.mkdir(parents=True)
    for name in ("cameras.bin", "images.bin"):
        (sparse / name).write_bytes((written / "binary" / "sparse" / "0" / name).read_bytes())
    data = bytearray((sparse / "images.bin").read_bytes())
    data[:8] = (1 << 60).to_bytes(8, "little")
    (sparse / "images.bin").write_bytes(data)
    with pytest.raises(UserError, match=f"says that it holds {1 << 60} records"):
        read_capture(tmp_path)
    (sparse / "images.bin").write_bytes(b"")
    with pytest.raises(UserError, match="ends too soon"):
        read_capture(tmp_path)


def test_an_image_of_no_camera_is_told(written: Path, tmp_path: Path) -> None:
    sparse = tmp_path / "sparse"
    sparse.mkdir()
    for name in ("cameras.txt", "images.txt"):
        text = (written / "text" / "sparse" / "0" / name).read_text()
        (sparse / name).write_text(text.replace("\n7 OPENCV", "\n8 OPENCV"))
    with pytest.raises(UserError, match=r"expected camera 7 of image view_000.png among the cameras"):
        read_capture(tmp_path)


def test_nan_is_read_from_json_and_left_to_the_checks(tmp_path: Path) -> None:
    made = replace(MADE, poses=orbit(2))
    made.write_transforms(tmp_path / "a", images=False)
    document = json.loads((tmp_path / "a" / "transforms.json").read_text())
    document["frames"][0]["transform_matrix"][0][3] = float("nan")
    (tmp_path / "a" / "transforms.json").write_text(json.dumps(document))
    assert np.isnan(read_capture(tmp_path / "a").shots[0].pose[0, 3])
