"""COLMAP's sparse models, text and binary: https://colmap.github.io/format.html. Mip-NeRF 360 comes like this, too."""

import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from dataset_builder.assets.pose_readers.capture import (
    Capture,
    CaptureShot,
    Lens,
    find_mask,
    guarded,
    inside,
    problem,
    rigid,
)
from dataset_builder.digest import open_regular
from dataset_builder.geometry.splat_moves import turn_matrices
from dataset_builder.spec.pose_files import model_folder

IMAGES = ("images", "input", "images_2", "images_4", "images_8")
"""Where its images may be, best first; the numbered ones are smaller."""
NAMES = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV",
         "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE")
"""Camera models by number."""
NUMBERS = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8}
"""How many parameters those have that are read."""
UNDISTORT = ("run `colmap image_undistorter --image_path images --input_path sparse/0 --output_path undistorted` and "
             "import that folder")


@dataclass(frozen=True, kw_only=True)
class _Image:
    name: str
    camera: int
    turn: tuple[float, ...]
    """w, x, y, z of camera from world."""
    place: tuple[float, ...]


def read_colmap(folder: Path, images: str | None = None, *, poses_only: bool = False) -> Capture:
    """The capture of a folder that holds a sparse model. images: the folder of its images, if not the usual one.
    poses_only: whether neither images nor points are looked for.

    Raises UserError for what is no whole model, and for lenses that are not read.
    """
    model = model_folder(folder)
    if model is None:
        raise problem(folder, "expected a sparse model, cameras.bin or cameras.txt, found none")
    return guarded(model, "a whole sparse model of COLMAP", lambda: _read(folder, model, images, poses_only))


def _read(folder: Path, model: Path, images: str | None, poses_only: bool) -> Capture:
    binary = (model / "cameras.bin").is_file()
    lenses = dict(_cameras_bin(model / "cameras.bin") if binary else _cameras_txt(model / "cameras.txt"))
    found = list(_images_bin(model / "images.bin") if binary else _images_txt(model / "images.txt"))
    points = dict[int, tuple[float, float, float]]()
    if not poses_only and (path := model / ("points3D.bin" if binary else "points3D.txt")).is_file():
        points = dict(_points_bin(path) if binary else _points_txt(path))
    root = folder / images if images else next((folder / name for name in IMAGES if (folder / name).is_dir()),
                                               folder / IMAGES[0])
    masks = folder / root.name.replace("images", "masks")
    masks = masks if masks.is_dir() else folder / "masks"
    shots = []
    for image in sorted(found, key=lambda image: image.name):
        if image.camera not in lenses:
            raise problem(model, f"expected camera {image.camera} of image {image.name} among the cameras, found none")
        path = Path(image.name) if poses_only else inside(root, image.name, str(model))
        shots.append(CaptureShot(name=image.name, image=path,
                                 mask=None if poses_only else find_mask(path, root, masks),
                                 lens=lenses[image.camera], pose=_pose(image)))
    return Capture(layout="COLMAP", shots=tuple(shots), points=points)


def _pose(image: _Image) -> np.ndarray:
    # One of no length is told with other cameras that are no numbers
    there = 0 < math.hypot(*image.turn) < math.inf
    turn = turn_matrices(np.array([image.turn]))[0] if there else np.full((3, 3), math.nan)
    return rigid(turn.T, -turn.T @ np.array(image.place))


def _lens(model: str, width: int, height: int, numbers: tuple[float, ...], where: str) -> Lens:
    if model not in NUMBERS:
        raise problem(where, f"expected a camera model of {', '.join(NUMBERS)}, got {model[:40]}", UNDISTORT)
    if len(numbers) != NUMBERS[model]:
        raise ValueError(f"{len(numbers)} parameters of {model}, which has {NUMBERS[model]}")
    alone = model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
    focal, rest = ((numbers[0],) * 2, numbers[1:]) if alone else (numbers[:2], numbers[2:])
    bend = (*rest[2:], 0.0, 0.0, 0.0, 0.0)[:4]
    return Lens(size=(width, height), focal=(focal[0], focal[1]), centre=(rest[0], rest[1]),
                bend=(bend[0], bend[1], bend[2], bend[3]))


def _lines(path: Path) -> Iterator[str]:
    with open_regular(path) as stream:
        for line in stream:
            if not line.startswith(b"#"):
                yield line.decode("utf-8", errors="replace").strip().removeprefix("\ufeff")


def _cameras_txt(path: Path) -> Iterator[tuple[int, Lens]]:
    for line in filter(None, _lines(path)):
        number, model, width, height, *rest = line.split()
        yield int(number), _lens(model, int(width), int(height), tuple(map(float, rest)), f"{path}: camera {number}")


def _images_txt(path: Path) -> Iterator[_Image]:
    """Every second line lists points of the image, x, y and number of each, and may be empty."""
    lines = _lines(path)
    for line in lines:
        words = line.split(maxsplit=9)
        if not words:
            continue
        if len(words) < 10:
            raise ValueError(f"the line {line[:60]!r} of images.txt")
        turn = tuple(map(float, words[1:8]))
        yield _Image(name=words[9], camera=int(words[8]), turn=turn[:4], place=turn[4:])
        points = next(lines, "").split()
        if points and (len(points) % 3 or not _is_number(points[-1])):
            raise problem(path, f"expected the points of image {words[9]} in the line after it, or an empty line, got "
                          f"{' '.join(points)[:60]}", "put an empty line after each image")


def _is_number(word: str) -> bool:
    return word.removeprefix("-").isdecimal()


def _points_txt(path: Path) -> Iterator[tuple[int, tuple[float, float, float]]]:
    for line in filter(None, _lines(path)):
        number, x, y, z, *_ = line.split(maxsplit=4)
        yield int(number), (float(x), float(y), float(z))


def _records(path: Path, least: int, read: Callable[[IO[bytes]], Any]) -> Iterator[Any]:
    """What `read` takes from a file for each of the records that it says to hold, of at least so many bytes each."""
    size = path.stat().st_size
    with open_regular(path) as stream:
        count, = _take(stream, "<Q")
        if count * least > size:
            raise ValueError(f"{size} bytes of {path.name}, which says that it holds {count} records")
        for _ in range(count):
            yield read(stream)


def _take(stream: IO[bytes], form: str) -> tuple[Any, ...]:
    data = stream.read(struct.calcsize(form))
    if len(data) < struct.calcsize(form):
        raise ValueError("a file that ends too soon")
    return struct.unpack(form, data)


def _cameras_bin(path: Path) -> Iterator[tuple[int, Lens]]:
    def read(stream: IO[bytes]) -> tuple[int, Lens]:
        number, model, width, height = _take(stream, "<iiQQ")
        name = NAMES[model] if 0 <= model < len(NAMES) else f"number {model}"
        numbers = _take(stream, f"<{NUMBERS[name]}d") if name in NUMBERS else ()
        return number, _lens(name, width, height, numbers, f"{path}: camera {number}")

    return _records(path, 24, read)


def _images_bin(path: Path) -> Iterator[_Image]:
    def read(stream: IO[bytes]) -> _Image:
        _, *turn, camera = _take(stream, "<i7di")
        name = bytearray()
        while (letter := stream.read(1)) not in (b"\0", b""):
            name += letter
        count, = _take(stream, "<Q")
        stream.seek(24 * min(count, 1 << 50), 1)
        return _Image(name=name.decode("utf-8", errors="replace"), camera=camera, turn=tuple(turn[:4]),
                      place=tuple(turn[4:]))

    return _records(path, 73, read)


def _points_bin(path: Path) -> Iterator[tuple[int, tuple[float, float, float]]]:
    def read(stream: IO[bytes]) -> tuple[int, tuple[float, float, float]]:
        number, x, y, z, *_, count = _take(stream, "<Q3d3BdQ")
        stream.seek(8 * min(count, 1 << 50), 1)
        return number, (x, y, z)

    return _records(path, 51, read)
