"""Views from cameras of a file, put into the room."""

import os
from collections.abc import Sequence
from math import atan, degrees

import numpy as np

from dataset_builder.assets.pose_readers.capture import Capture, CaptureShot, Lens
from dataset_builder.assets.pose_readers.colmap import read_colmap
from dataset_builder.assets.pose_readers.transforms_json import read_transforms_poses
from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError, UserError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.geometry.turns import upright
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.scene.assets_of_plan import turned_up
from dataset_builder.planning.view.view_path import PathFrame, ViewPath, level_with, placed_at
from dataset_builder.spec.camera_path import PosesSpec
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.pose_files import pose_files
from dataset_builder.spec.render import ImageSpec
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spread import spread_indices

STRAY = 1e-3
"""How far a rotation of a file may be from one."""
LEVEL = 1e-7
"""Height of a camera's unit right axis up to which its horizon is level."""
TOLD, VISIBLE = 1e-4, 0.02
"""Widths of the image that a lens without what is not honoured moves pixels by: told from the first on, refused from
the second."""
TOLD_FAULTS = 5
"""Poses with a fault that are named."""
ASPECT = 0.005
"""Share by which the height of a file's images may differ from that of ours, widths being equal, before it is told."""
HINT = ("set `scale`, `about` and `up` of `camera.path` such that the cameras see the object, make the room larger, or "
        "widen `camera.coverage` and lower `camera.visibility`")


def read_poses(loaded: LoadedSpec, path: PosesSpec, place: KeyPath, views: int) -> Capture:
    """The cameras of the file that a path names, checked. place: of `path` in the dataset file.

    Raises PlanError with the line that names the file: where it cannot be read, where it changed since the spec was
    read, where a pose is no rotation and a place, where no field of view is known, and where there are fewer poses than
    views.
    """
    root, at = loaded.path.parent, (*place, "file")
    files = pose_files(root / path.file)
    try:
        known = {os.path.abspath(root / name): digest for name, digest in loaded.pose_files.items()}
        if not files or any(sha256_file(file) != known.get(os.path.abspath(file)) for file in files):
            raise UserError("expected the file that was there when the spec was read, got another: start again")
        whole = files[0].suffix.lower() == ".json"
        found = read_transforms_poses(files[0]) if whole else read_colmap(files[0].parent, poses_only=True)
    except UserError as error:
        raise PlanError([loaded.problem("", at, ": ".join(filter(None, (each.where, each.path, each.rule))), each.hint)
                         for each in error.problems]) from error
    except OSError as error:
        raise PlanError([loaded.problem("", at, f"expected a readable file, got: {error.strerror}")]) from error
    rules = [rule for shot in found.shots if (rule := _fault(shot, lens_counts=path.fov is None))]
    problems = [loaded.problem("", at, rule) for rule in rules[:TOLD_FAULTS]]
    if len(rules) > TOLD_FAULTS:
        problems.append(loaded.problem("", at, f"expected no fault in any pose, got {len(rules)} of "
                                       f"{len(found.shots)} with one, of which the first are named"))
    if len(found.shots) < views:
        problems.append(loaded.problem("", at, f"expected at least as many poses as the {views} `views` of the "
                                       f"split, got {len(found.shots)}", "lower `views`"))
    if problems:
        raise PlanError(problems)
    return found


def _fault(shot: CaptureShot, *, lens_counts: bool) -> str:
    """What is wrong with one pose, or nothing."""
    turn = shot.pose[:3, :3]
    if not np.isfinite(shot.pose).all():
        return f"expected finite numbers, got NaN or Inf in the pose of {shot.name}"
    if np.abs(turn @ turn.T - np.eye(3)).max() > STRAY or np.linalg.det(turn) < 0:
        return (f"expected a rotation, determinant 1, in the pose of {shot.name}, got {np.linalg.det(turn):.4f}: take "
                "scale and mirroring out of the matrix")
    if not lens_counts:
        return ""
    lens = shot.lens
    if not np.isfinite([*lens.focal, *lens.centre, *lens.bend, lens.angle]).all() or not 1 <= lens_fov(lens) <= 170:
        return (f"expected a field of view of 1 to 170 degrees for {shot.name}, got {lens_fov(lens):.4g}: the file "
                "needs camera_angle_x, or fl_x with w (or write `fov` beside it)")
    if (off := lens_error(lens)) > VISIBLE:
        return (f"expected the lens of {shot.name} to be near a pinhole's whose principal point is the middle, got one "
                f"that moves pixels by {off:.1%} of the width: undistort the poses, or write `fov` beside the file")
    return ""


def lens_fov(lens: Lens) -> float:
    """Horizontal field of view in degrees; 0 where it is not known."""
    if lens.size[0] > 0 and lens.focal[0] > 0:
        return degrees(2 * atan(lens.size[0] / 2 / lens.focal[0]))
    return degrees(lens.angle)


def lens_error(lens: Lens) -> float:
    """How far the pinhole of the same field of view, with square pixels and the principal point in the middle, is off
    a lens at most: in widths of the image, along its edges."""
    width, height = lens.size
    if not (width > 0 and height > 0 and min(lens.focal) > 0):
        return 0.0
    share = np.linspace(-0.5, 0.5, 17)
    edge = np.concatenate([np.column_stack(pair) for end in (-0.5, 0.5) for pair in
                           ((share, np.full(17, end)), (np.full(17, end), share))]) * [width, height]
    ways = edge / lens.focal[0]
    return float(np.linalg.norm(lens.pixels(ways) - (edge + np.array([width, height]) / 2), axis=1).max() / width)


def plan_poses(arrangement: Arrangement, path: PosesSpec, found: Capture, image: ImageSpec, views: int) -> ViewPath:
    """The first to the last of the file's cameras, or as many of them, evenly spread."""
    turn, origin = upright(path.up, 0.0)[:3, :3], np.zeros(3)
    if path.about == "object":
        turn, origin = turned_up(arrangement.target.yaw) @ turn, arrangement.centre
    chosen = [found.shots[k] for k in spread_indices(len(found.shots), views)]
    frames = []
    for shot in chosen:
        position = origin + path.scale * turn @ shot.pose[:3, 3]
        right, down, forward = (turn @ shot.pose[:3, :3]).T
        # A camera that is not rolled is written as all others are
        up = np.array([0.0, 0.0, 1.0]) if abs(right[2]) <= LEVEL and down[2] < 0 and abs(forward[2]) < 0.999 else -down
        fov = lens_fov(shot.lens) if path.fov is None else path.fov
        pinhole = Pinhole(position=position, target=level_with(arrangement, position, position + forward), fov=fov,
                          width=image.width, height=image.height, up=up)
        frames.append(PathFrame(pinhole=pinhole, said=f"{shot.name}, {placed_at(position)}"))
    note = "; ".join([f"poses: {views} of {len(found.shots)} of {path.file}" + ", evenly spread" * (
        views < len(found.shots)), *_lens_notes(chosen, path, image)])
    return ViewPath(kind="poses", frames=tuple(frames), note=note, hint=HINT)


def _lens_notes(shots: Sequence[CaptureShot], path: PosesSpec, image: ImageSpec) -> list[str]:
    """What of the lenses of a file is left out."""
    if path.fov is not None:
        return [f"its lenses are not used, {path.fov:g} degrees are given"]
    said = []
    off = max(lens_error(shot.lens) for shot in shots)
    if off > TOLD:
        said.append("its principal points, aspects of pixels and distortion are left out, which moves pixels by up to "
                    f"{off:.2%} of the width")
    aspects = {round(shot.lens.size[1] / shot.lens.size[0], 4) for shot in shots if shot.lens.size[0] > 0}
    if any(abs(aspect - image.height / image.width) > ASPECT for aspect in aspects):
        said.append("its images have another aspect: the horizontal field of view is kept")
    return said
