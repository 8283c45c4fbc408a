"""Which way is up, where the front is, and how long a metre is: from a capture's own frame to that of its object."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.assets.pose_readers.capture import Capture, listed, problem
from dataset_builder.geometry.planes import largest_plane
from dataset_builder.importing.captures.photographs import Ball

LEVEL = 0.35
"""Up is square to the cameras' right axes where these vary along it less than this share of how they vary across."""
WEAK = 0.3
"""Length of the mean of the cameras' up axes below which they say nothing."""
FEWEST_POINTS, PLANE = 50, 0.1
"""Points that a plane is sought among, and the least share of them on it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CapturePlacement:
    """From a capture's frame to its object's: metres, Z up, front towards -Y."""

    turn: np.ndarray
    """(3, 3) rotation, object from capture."""
    scale: float
    """Metres per unit of the capture."""
    origin: np.ndarray
    """(3,) in the capture's frame, which becomes (0, 0, 0)."""

    def points(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) metres of (..., 3) points of the capture."""
        return self.scale * (points - self.origin) @ self.turn.T

    def poses(self, poses: np.ndarray) -> np.ndarray:
        """(N, 4, 4) of the capture's (N, 4, 4) poses."""
        moved = poses.copy()
        moved[:, :3, :3] = self.turn @ poses[:, :3, :3]
        moved[:, :3, 3] = self.points(poses[:, :3, 3])
        return moved


def up_of(capture: Capture, asked: Sequence[float] | str, ball: Ball) -> tuple[np.ndarray, str]:
    """(3,) unit vector that points up in the capture's frame, and who says so. asked: that vector, `cameras`, or
    `plane`. Raises UserError where it cannot be told."""
    if not isinstance(asked, str):
        up = np.array(asked, dtype=np.float64)
        if not np.isfinite(up).all() or not np.linalg.norm(up) > 0:
            raise problem("", f"expected a direction, got {', '.join(f'{value:g}' for value in asked)}", path="--up")
        return up / np.linalg.norm(up), "up as given"
    poses = np.stack([shot.pose for shot in capture.shots])
    return _of_plane(capture, poses, ball) if asked == "plane" else _of_cameras(poses)


def _of_cameras(poses: np.ndarray) -> tuple[np.ndarray, str]:
    """Level cameras have their right axes across: up is square to these, and on the side of their own up axes."""
    own = -poses[:, :3, 1].mean(axis=0)
    if np.linalg.norm(own) < WEAK:
        raise problem("", "expected cameras that agree on what is up, got up axes in all directions (their mean is "
                      f"{np.linalg.norm(own):.2f} long)", "give it as --up X,Y,Z in the capture's frame, or --up plane",
                      path="--up")
    rights = poses[:, :3, 0]
    _, spread, axes = np.linalg.svd(rights, full_matrices=False)
    up = axes[2] * np.sign(axes[2] @ own) if spread[2] < LEVEL * spread[1] else own
    up = up / np.linalg.norm(up)
    tilt = np.degrees(np.sqrt(np.mean(np.arcsin(np.clip(rights @ up, -1, 1)) ** 2)))
    return up, f"up from the cameras, which are level to {tilt:.1f} degrees (rms)"


def _of_plane(capture: Capture, poses: np.ndarray, ball: Ball) -> tuple[np.ndarray, str]:
    """Square to the plane of most points, on the side of the cameras."""
    points = np.array(list(capture.points.values())).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < FEWEST_POINTS:
        raise problem("", f"expected at least {FEWEST_POINTS} points to find a plane among, got {len(points)}",
                      "give --up X,Y,Z, or leave it to the cameras", path="--up plane")
    normal, share = largest_plane(points)
    if share < PLANE:
        raise problem("", f"expected {PLANE:.0%} of the points on a plane, got {share:.0%}",
                      "give --up X,Y,Z, or leave it to the cameras", path="--up plane")
    side = np.sign(((poses[:, :3, 3] - ball.centre) @ normal).mean()) or 1.0
    return normal * side, f"up from the plane that {share:.0%} of the points lie on"


def turned(up: np.ndarray, first: np.ndarray, yaw: float) -> np.ndarray:
    """(3, 3) rotation that brings `up` to +Z and the direction `first` (3,) above -Y, and then turns the object
    counter-clockwise by `yaw` degrees, seen from above."""
    front = first - (first @ up) * up
    if np.linalg.norm(front) < 1e-6 * np.linalg.norm(first):
        front = np.cross(up, [1.0, 0, 0] if abs(up[0]) < 0.9 else [0, 1.0, 0])
    front /= np.linalg.norm(front)
    turn = np.stack([np.cross(up, front), -front, up])
    angle = np.radians(yaw)
    about = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    return about @ turn


def metres_per_unit(capture: Capture, distance: tuple[str, str, float] | None) -> tuple[float, str]:
    """Metres per unit of the capture and who says so; 0 where nothing does. distance: two names of images, whose
    cameras are meant, or two of points, `point:7`, and metres between. Raises UserError for names that there are
    not."""
    if distance is None:
        return (1.0, f"{capture.layout} is in metres") if capture.metric else (0.0, "")
    first, second, metres = distance
    apart = float(np.linalg.norm(_named(capture, first) - _named(capture, second)))
    if not apart > 0:
        raise problem("", f"expected two places, got {first} and {second}, which are one", path="--distance")
    return metres / apart, f"scale from {metres:g} m between {first} and {second}"


def _named(capture: Capture, name: str) -> np.ndarray:
    """(3,) of a camera or a point."""
    if name.startswith("point:") and name[6:].isdecimal() and int(name[6:]) in capture.points:
        return np.array(capture.points[int(name[6:])])
    found = [shot for shot in capture.shots if name in (shot.name, shot.image.name, shot.image.stem)]
    if len(found) != 1:
        kinds = listed(shot.name for shot in capture.shots)
        raise problem("", f"expected the name of one image ({kinds}) or a point such as point:1, got {name}, which "
                      f"{'is none' if not found else f'are {len(found)}'}", path="--distance")
    return np.asarray(found[0].pose[:3, 3])
