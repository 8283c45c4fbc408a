"""ActorsHQ: cameras on a rig, of whose videos one frame is one object.

`calibration.csv`, as `actorshq/dataset/camera_data.py` of the dataset's authors reads it: rotation as axis times angle
and translation of `world_from_camera`, OpenCV's axes, metres; focal lengths and principal points are in widths (x) and
heights (y) of the image.
"""

import csv
import io
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from dataset_builder.assets.pose_readers.capture import Capture, CaptureShot, Lens, guarded, inside, problem, rigid
from dataset_builder.digest import read_regular

CALIBRATION = "calibration.csv"
MOST_BYTES = 1 << 24
VIDEOS = (".mp4", ".mov", ".mkv", ".avi", ".webm")
COLUMNS = ("w", "h", "rx", "ry", "rz", "tx", "ty", "tz", "fx", "fy", "px", "py")


def read_actors_hq(folder: Path, frame: int) -> Capture:
    """One frame of a folder such as `Actor01/Sequence1/4x`: `rgbs/Cam001/Cam001_rgb000000.jpg` and `masks/Cam001/
    Cam001_mask000000.png` of every camera that has images there. Raises UserError."""
    path = folder / CALIBRATION
    return guarded(path, f"a table of cameras with the columns name, {', '.join(COLUMNS)}",
                   lambda: _read(folder, path, frame))


def _read(folder: Path, path: Path, frame: int) -> Capture:
    text = read_regular(path, most=MOST_BYTES).decode("utf-8")
    shots, videos = [], []
    for row in csv.DictReader(io.StringIO(text), skipinitialspace=True):
        name = row["name"]
        numbers = [float(row[column]) for column in COLUMNS]
        width, height, turn, place, optics = round(numbers[0]), round(numbers[1]), numbers[2:5], numbers[5:8], \
            numbers[8:]
        where = inside(folder / "rgbs", name, str(path))
        if not where.is_dir():
            videos += [video for ending in VIDEOS if (video := where.with_suffix(ending)).is_file()]
            continue
        images = (where / f"{name}_rgb{frame:06d}{ending}" for ending in (".jpg", ".png"))
        image = next((image for image in images if image.is_file()), where / f"{name}_rgb{frame:06d}.jpg")
        mask = folder / "masks" / name / f"{name}_mask{frame:06d}.png"
        lens = Lens(size=(width, height), focal=(optics[0] * width, optics[1] * height),
                    centre=(optics[2] * width, optics[3] * height))
        shots.append(CaptureShot(name=name, image=image, mask=mask if (folder / "masks").is_dir() else None, lens=lens,
                                 pose=rigid(Rotation.from_rotvec(turn).as_matrix(), np.array(place))))
    if videos and not shots:
        first = videos[0]
        raise problem(first, "expected a folder of frames for every camera, got videos",
                      f"for every video: mkdir {first.with_suffix('')}; ffmpeg -i {first} -start_number 0 "
                      f"{first.with_suffix('')}/{first.stem}_rgb%06d.png")
    return Capture(layout="ActorsHQ", shots=tuple(shots), metric=True)
