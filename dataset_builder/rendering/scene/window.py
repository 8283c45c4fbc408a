"""Which pixels matter: those the object may cover, found by projection before anything is traced."""

import numpy as np

from dataset_builder.label.example_plan import CameraPlan


def camera_axes(camera: CameraPlan) -> np.ndarray:
    """(3, 3) rows: right, up, forward unit vectors in world space."""
    position, target, up = (np.array(vector) for vector in (camera.position, camera.target, camera.up))
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def project(camera: CameraPlan, points: np.ndarray, width: int, height: int) -> np.ndarray:
    """(N, 3) pixel column, pixel row, and distance along the view axis in metres, of (N, 3) world points.

    Pixel (0, 0) is the upper left one and covers [0, 1) x [0, 1). Points behind the camera have a negative distance and
    meaningless pixels.
    """
    right, up, forward = ((points - np.array(camera.position)) @ camera_axes(camera).T).T
    scale = width / (2 * np.tan(np.radians(camera.fov) / 2))
    distance = np.where(np.abs(forward) < 1e-9, 1e-9, forward)
    return np.stack([width / 2 + scale * right / distance, height / 2 - scale * up / distance, forward], axis=-1)


def covered_window(camera: CameraPlan, points: np.ndarray, width: int, height: int) -> np.ndarray:
    """Indices row * width + column of the smallest rectangle of pixels that holds the projection of all points.

    The whole frame where a point lies behind the camera; empty where the object is out of the frame.
    """
    column, row, distance = project(camera, points, width, height).T
    if distance.min() <= 0:
        return np.arange(width * height)
    left, right = np.clip([np.floor(column.min()) - 1, np.floor(column.max()) + 2], 0, width).astype(int)
    top, bottom = np.clip([np.floor(row.min()) - 1, np.floor(row.max()) + 2], 0, height).astype(int)
    return (np.arange(top, bottom)[:, None] * width + np.arange(left, right)).ravel()
