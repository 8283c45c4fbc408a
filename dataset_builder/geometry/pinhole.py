"""The pinhole camera of labels: its axes, its matrices, and the way between pixels with depths and points in the world.

The world is Z up and right-handed, lengths are metres. Pixel (column 0, row 0) is the upper left one and covers
[0, 1) x [0, 1), so that centres lie at halves. Formulas: Hartley and Zisserman, Multiple View Geometry, chapter 6.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from dataset_builder.label.scene_plan import CameraPlan

NEAR = 1e-9
"""Least distance in metres that a projection divides by."""


def look_at(position: Sequence[float] | np.ndarray, target: Sequence[float] | np.ndarray,
            up: Sequence[float] | np.ndarray = (0.0, 0.0, 1.0)) -> np.ndarray:
    """(3, 3) rows right, up and forward: unit vectors in the world, of a camera at `position` that aims at `target`.

    The row up is square to the other two; `up` (3,), not along the view, only says which way it points.
    """
    forward = unit(np.subtract(target, position))
    right = unit(np.cross(forward, up))
    return np.stack([right, np.cross(right, forward), forward])


def sphere_lattice(count: int) -> np.ndarray:
    """(count, 3) unit vectors evenly on the sphere, from +Z down: a Fibonacci lattice (Gonzalez, "Measurement of areas
    on a sphere using Fibonacci and latitude-longitude lattices", 2010)."""
    k = np.arange(count) + 0.5
    z, azimuth = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), z], axis=1)


def unit(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors brought to length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class Pinhole:
    """A pinhole camera and its frame; pixels are square, the principal point is the middle."""

    position: np.ndarray
    """(3,) where it is, metres."""
    target: np.ndarray
    """(3,) what it aims at, metres."""
    fov: float
    """Horizontal, degrees, between 0 and 180."""
    width: int
    """Of the frame, pixels."""
    height: int
    """Of the frame, pixels."""
    up: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """(3,), see `look_at`."""

    @classmethod
    def of(cls, camera: CameraPlan, width: int, height: int) -> Self:
        """The camera of a label, `label.plan.camera`, with a frame of `width` by `height` pixels."""
        return cls(position=np.array(camera.position), target=np.array(camera.target), up=np.array(camera.up),
                   fov=camera.fov, width=width, height=height)

    @property
    def aspect(self) -> float:
        """Height over width."""
        return self.height / self.width

    @property
    def basis(self) -> np.ndarray:
        """(3, 3) rows right, up and forward, in the world."""
        return look_at(self.position, self.target, self.up)

    @property
    def focal(self) -> float:
        """Focal length in pixels, the same along columns and rows."""
        return float(self.width / (2 * np.tan(np.radians(self.fov) / 2)))

    @property
    def intrinsics(self) -> np.ndarray:
        """(3, 3) K of OpenCV: K @ (x, y, z) / z is (column, row, 1), with x right, y down and z forward."""
        return np.array([[self.focal, 0, self.width / 2], [0, self.focal, self.height / 2], [0, 0, 1.0]])

    @property
    def opencv_extrinsics(self) -> np.ndarray:
        """(4, 4) camera from world as OpenCV has it: x right, y down, z forward."""
        axes = self.basis * np.array([[1], [-1], [1]])
        return np.vstack([np.column_stack([axes, -axes @ self.position]), [0, 0, 0, 1]])

    @property
    def opencv_pose(self) -> np.ndarray:
        """(4, 4) world from camera, `opencv_extrinsics` the other way."""
        axes = self.basis * np.array([[1], [-1], [1]])
        return np.vstack([np.column_stack([axes.T, self.position]), [0, 0, 0, 1]])

    @property
    def opengl_pose(self) -> np.ndarray:
        """(4, 4) world from camera as OpenGL and Blender have it: x right, y up, z back, to the viewer."""
        axes = self.basis * np.array([[1], [1], [-1]])
        return np.vstack([np.column_stack([axes.T, self.position]), [0, 0, 0, 1]])

    def project(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) column and row in pixels, and distance along the view axis in metres, of (N, 3) points in the world.

        Points behind the camera have a negative distance and meaningless pixels.
        """
        right, up, forward = ((points - self.position) @ self.basis.T).T
        distance = np.where(np.abs(forward) < NEAR, NEAR, forward)
        return np.stack([self.width / 2 + self.focal * right / distance,
                         self.height / 2 - self.focal * up / distance, forward], axis=-1)

    def directions(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(..., 3) ways through places of the frame, in pixels, that broadcast; each goes 1 along the view axis."""
        right, up, forward = self.basis
        half = np.tan(np.radians(self.fov) / 2)
        x = (2 * columns / self.width - 1) * half
        y = (1 - 2 * rows / self.height) * half * self.height / self.width
        return forward + x[..., None] * right + y[..., None] * up

    def unproject(self, depth: np.ndarray) -> np.ndarray:
        """(H, W, 3) points in the world that pixel centres see at a `depth` (H, W): metres along the view axis, as the
        layer `depth` has it. Raises ValueError where the depth is not of this frame."""
        if depth.shape != (self.height, self.width):
            raise ValueError(f"expected a depth of shape {(self.height, self.width)}, got {depth.shape}")
        ways = self.directions(np.arange(self.width) + 0.5, np.arange(self.height)[:, None] + 0.5)
        return self.position + depth[..., None].astype(np.float64) * ways
