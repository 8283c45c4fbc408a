"""`transforms.json` of nerfstudio and instant-ngp, and of the synthetic scenes of NeRF.

Poses are `world_from_camera` with OpenGL's axes, y up and z to the viewer:
https://docs.nerf.studio/quickstart/data_conventions.html
"""

import json
import math
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ValidationError

from dataset_builder.assets.image_maps import ImageFile, check_image
from dataset_builder.assets.pose_readers.capture import (
    Capture,
    CaptureShot,
    Lens,
    find_mask,
    guarded,
    inside,
    problem,
)
from dataset_builder.digest import read_regular
from dataset_builder.errors import UserError
from dataset_builder.spec.pose_files import MOST_BYTES, TRANSFORMS, transforms_file
from dataset_builder.spec.problems import dotted, shown

ENDINGS = (".png", ".jpg", ".jpeg", ".JPG", ".webp")
"""Of images that are named without one."""
READ = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE")
"""Camera models that are pinholes with two radial and two tangential terms, or fewer."""
EXPECTED = {"model_type": "a mapping", "list_type": "a list", "float_type": "a number",
            "float_parsing": "a number", "string_type": "text", "bool_type": "true or false",
            "bool_parsing": "true or false"}
"""What pydantic calls by its own names."""
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenGL's camera from OpenCV's, and back."""


class _Optics(BaseModel):
    camera_model: str | None = None
    fl_x: float | None = None
    fl_y: float | None = None
    cx: float | None = None
    cy: float | None = None
    w: float | None = None
    h: float | None = None
    camera_angle_x: float | None = None
    camera_angle_y: float | None = None
    k1: float | None = None
    k2: float | None = None
    k3: float | None = None
    k4: float | None = None
    p1: float | None = None
    p2: float | None = None
    is_fisheye: bool | None = None


class _Frame(_Optics):
    file_path: str = ""
    transform_matrix: list[list[float]]
    mask_path: str | None = None


class _Transforms(_Optics):
    frames: list[_Frame]
    applied_transform: list[list[float]] | None = None


def read_transforms(folder: Path) -> Capture:
    """The capture of a folder. What `applied_transform` did to the poses is undone, so that they are those of the
    reconstruction. Raises UserError for what is no such file, and for lenses that are not read."""
    path = transforms_file(folder)
    if path is None:
        raise problem(folder, f"expected {TRANSFORMS[0]}, found none")
    return guarded(path, "frames with their poses", lambda: _read(path, poses_only=False))


def read_transforms_poses(path: Path) -> Capture:
    """The cameras of a file alone: nothing is asked of their images. Raises UserError as `read_transforms` does."""
    return guarded(path, "frames with their poses", lambda: _read(path, poses_only=True))


def _read(path: Path, *, poses_only: bool) -> Capture:
    try:
        file = _Transforms.model_validate(json.loads(read_regular(path, most=MOST_BYTES)))
    except ValidationError as error:
        first = error.errors()[0]
        more = f", and {error.error_count() - 1} more" * (error.error_count() > 1)
        rule = ("expected a value, the key is missing" if first["type"] == "missing" else
                f"expected {EXPECTED.get(first['type'], first['msg'])}, got {shown(first['input'])}")
        raise problem(path, rule + more, path=dotted(first["loc"])) from error
    undo = np.linalg.inv(_matrix(file.applied_transform)) if file.applied_transform else np.eye(4)
    shots = []
    for index, frame in enumerate(file.frames):
        where = f"{path}: frames[{index}]"
        if poses_only:
            name, image, mask = frame.file_path or f"frames[{index}]", Path(frame.file_path), None
        elif frame.file_path:
            image = _image(path, frame.file_path)
            name = image.relative_to(path.parent).as_posix()
            mask = inside(path.parent, frame.mask_path, str(path)) if frame.mask_path else _mask(path.parent, image)
        else:
            raise problem(where, "expected the image of a pose, found none", path="file_path")
        shots.append(CaptureShot(name=name, image=image, mask=mask,
                                 lens=_lens(file, frame, None if poses_only else image, where),
                                 pose=undo @ _matrix(frame.transform_matrix) @ OPENGL))
    return Capture(layout="transforms.json", shots=tuple(shots))


def _matrix(rows: list[list[float]]) -> np.ndarray:
    matrix = np.array(rows, dtype=np.float64)
    if matrix.shape not in ((3, 4), (4, 4)):
        raise ValueError(f"a matrix of shape {matrix.shape}")
    return np.vstack([matrix[:3], [0.0, 0.0, 0.0, 1.0]])


def _mask(folder: Path, image: Path) -> Path | None:
    """In `masks_4` beside `images_4`, or else in `masks`, where images below `images` are below it likewise."""
    first, *rest = image.relative_to(folder).parts
    images = folder / first if rest else folder
    masks = folder / first.replace("images", "masks")
    if masks == images or not masks.is_dir():
        masks = folder / "masks"
    found = find_mask(image, images, masks)
    beside = find_mask(image, image.parent, masks)
    return beside if beside and beside.is_file() and not (found and found.is_file()) else found


def _image(path: Path, name: str) -> Path:
    image = inside(path.parent, name, str(path))
    others = (image.with_name(image.name + ending) for ending in ENDINGS)
    return image if image.is_file() else next((other for other in others if other.is_file()), image)


def _lens(file: _Transforms, frame: _Frame, image: Path | None, where: str) -> Lens:
    """Of a frame; what it does not say, the file says for all. image: whose size it has, where neither says it."""
    own = frame.model_dump(exclude_none=True)
    # Without all other frames, of which there may be thousands
    said = {**file.model_dump(exclude={"frames"}, exclude_none=True), **own}
    for angle, length in (("camera_angle_x", "fl_x"), ("camera_angle_y", "fl_y")):
        if angle in own and length not in own:
            said.pop(length, None)
        if not 0 < said.get(angle, 1.0) < math.pi and not said.get(length):
            raise problem(where, f"expected an angle between 0 and pi radians, got {said[angle]:g}",
                          "convert degrees to radians", path=angle)
    model = str(said.get("camera_model", READ[0]))
    if model not in READ or said.get("is_fisheye") or said.get("k3") or said.get("k4"):
        raise problem(where, f"expected a camera model of {', '.join(READ)} without k3 and k4, got {model[:40]}",
                      "undistort the images and import those")
    told = said.get("w") and said.get("h")
    size = (round(said["w"]), round(said["h"])) if told else _size(image) if image else (0, 0)
    x = said.get("fl_x") or (size[0] / 2 / math.tan(said["camera_angle_x"] / 2) if "camera_angle_x" in said else 0.0)
    y = said.get("fl_y") or (size[1] / 2 / math.tan(said["camera_angle_y"] / 2) if "camera_angle_y" in said else x)
    if size != (0, 0) and not x:
        raise problem(where, "expected fl_x or camera_angle_x, found neither")
    return Lens(size=size, focal=(x, y), centre=(said.get("cx", size[0] / 2), said.get("cy", size[1] / 2)),
                angle=float(said.get("camera_angle_x", 0.0)),
                bend=(said.get("k1", 0.0), said.get("k2", 0.0), said.get("p1", 0.0), said.get("p2", 0.0)))


def _size(image: Path) -> tuple[int, int]:
    """From the image's header; (0, 0) where there is none, which is told with other missing files."""
    try:
        return check_image(ImageFile(name=str(image), content=image))
    except UserError:
        return 0, 0
