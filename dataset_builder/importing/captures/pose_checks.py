"""What can be said of a capture before a pixel is read: numbers of its cameras, files, and where cameras stand."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.assets.pose_readers.capture import Capture, CaptureShot
from dataset_builder.errors import Problem
from dataset_builder.importing.captures.photographs import file_faults

FEWEST, FEW = 8, 20
"""Images below which a capture is refused, and told to be thin."""
STRAY = 1e-3
"""How far the determinant of a rotation may be from 1."""
WIDEST = 60.0
"""Degrees between neighbouring cameras, seen from above, from which the side between is told to be a guess."""


def pose_faults(shot: CaptureShot) -> list[Problem]:
    """What is wrong with the numbers of one camera."""
    numbers = np.array([*shot.lens.focal, *shot.lens.centre, *shot.lens.bend])
    where = f"{shot.image}: camera"
    if not np.isfinite(shot.pose).all() or not np.isfinite(numbers).all():
        return [Problem(where=where, path="", rule="expected finite numbers, got NaN or Inf",
                        hint="leave the image out, or reconstruct its pose again")]
    if min(shot.lens.focal) <= 0:
        return [Problem(where=where, path="", rule=f"expected focal lengths above 0, got {min(shot.lens.focal):g}",
                        hint="calibrate it again")]
    turn = shot.pose[:3, :3]
    size = float(np.linalg.det(turn))
    if abs(size + 1) <= STRAY:
        return [Problem(where=where, path="", rule=f"expected a rotation, determinant 1, got {size:.4f}: a mirrored "
                        "camera", hint="one axis is negated too many or too few; OpenGL's axes differ from OpenCV's in "
                        "y and z, both negated")]
    if abs(size - 1) > STRAY or np.abs(turn @ turn.T - np.eye(3)).max() > STRAY:
        return [Problem(where=where, path="", rule=f"expected a rotation, determinant 1 within {STRAY:g}, got "
                        f"{size:.4f}", hint="take scale out of the matrix")]
    return []


def shot_faults(capture: Capture) -> list[list[Problem]]:
    """What is wrong with every shot: its camera and its files."""
    faults = [[*pose_faults(shot), *file_faults(shot)] for shot in capture.shots]
    seen = dict[tuple[str, str], int]()
    for index, shot in enumerate(capture.shots):
        first = seen.setdefault((str(shot.image), shot.name), index)
        if first != index:
            faults[index].append(Problem(where=str(shot.image), path="", rule="expected each image once, got two poses "
                                         "of this one", hint="remove one"))
    return faults


def shortened(problems: Sequence[Problem], most: int = 20) -> list[Problem]:
    """The first problems, and how many more there are."""
    more = len(problems) - most
    rest = [Problem(where="", path="", rule=f"{more} more problems of this kind")] if more > 0 else []
    return [*problems[:most], *rest]


def too_few(count: int, where: str) -> list[Problem]:
    """The problem of a capture with too few images."""
    return [Problem(where=where, path="", rule=f"expected at least {FEWEST} usable images, got {count}",
                    hint="photograph the object from all around, 50 to 200 times")] if count < FEWEST else []


def camera_notes(capture: Capture, centre: np.ndarray, up: np.ndarray) -> list[str]:
    """What is to be told of the cameras, but does not stop an import: that they are few, and the widest gap between
    them around the object, seen from above."""
    notes = []
    if len(capture.shots) < FEW:
        notes.append(f"{len(capture.shots)} images; below {FEW} a field guesses much")
    gap = widest_gap(np.array([shot.pose[:3, 3] for shot in capture.shots]) - centre, up)
    if gap > WIDEST:
        notes.append(f"{gap:.0f} degrees around the object have no camera (more than {WIDEST:.0f}); what is seen from "
                     "there only is a guess")
    return notes


def widest_gap(offsets: np.ndarray, up: np.ndarray) -> float:
    """Widest angle in degrees between neighbouring directions, (N, 3) from the object, about the axis `up` (3,)."""
    right = np.cross(up, [1.0, 0, 0] if abs(up[0]) < 0.9 else [0, 1.0, 0])
    right /= np.linalg.norm(right)
    angles = np.sort(np.degrees(np.arctan2(offsets @ np.cross(up, right), offsets @ right)))
    return float(np.diff([*angles, angles[0] + 360]).max())
