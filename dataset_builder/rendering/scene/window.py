"""Which pixels matter: those the object may cover, found by projection before anything is traced."""

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole


def covered_window(camera: Pinhole, points: np.ndarray) -> np.ndarray:
    """Indices row * width + column of the smallest rectangle of pixels that holds the projection of all points (N, 3).

    The whole frame where a point lies behind the camera; empty where the object is out of the frame.
    """
    column, row, distance = camera.project(points).T
    if distance.min() <= 0:
        return np.arange(camera.width * camera.height)
    left, right = np.clip([np.floor(column.min()) - 1, np.floor(column.max()) + 2], 0, camera.width).astype(int)
    top, bottom = np.clip([np.floor(row.min()) - 1, np.floor(row.max()) + 2], 0, camera.height).astype(int)
    return (np.arange(top, bottom)[:, None] * camera.width + np.arange(left, right)).ravel()
