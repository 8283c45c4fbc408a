"""Posed images of a ball, worked out by hand, and fields fitted to them."""

from pathlib import Path

import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.field.field_fit import FieldSettings, FitProgress, fit_field

CENTRE, RADIUS = (0.3, -0.2, 0.5), 0.4
"""Of the ball that the field fills, metres."""
BALL = 0.8
"""Radius of the ball that is seen, in RADIUS."""
FOV = 40.0
SETTINGS = FieldSettings(kind="density", resolution=48, steps=150, seed=5)


def sphere_directions(count: int, turn: float = 0.0) -> np.ndarray:
    """(N, 3) Fibonacci lattice on the sphere."""
    k = np.arange(count) + 0.5
    z, phi = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k + turn
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(phi), flat * np.sin(phi), z], axis=1)


def poses_about(directions: np.ndarray, distance: float) -> np.ndarray:
    """(N, 4, 4) frame_from_camera of cameras that look at CENTRE from so many metres."""
    poses = np.tile(np.eye(4), (len(directions), 1, 1))
    for pose, way in zip(poses, directions, strict=True):
        right = np.cross(-way, [0.1, 0.2, 1.0])
        right /= np.linalg.norm(right)
        pose[:3, :3] = np.stack([right, np.cross(-way, right), -way], axis=1)
        pose[:3, 3] = np.array(CENTRE) + distance * way
    return poses


def marble(normals: np.ndarray) -> np.ndarray:
    """(..., 3) colours of a ball, in [0.1, 0.9]."""
    return 0.5 + 0.4 * np.sin(4 * normals + np.array([0, 1, 2]))


def ball_images(directions: np.ndarray, *, size: int = 64, across: int = 3, colour=marble, ball: float = BALL,
                distance: float = 1.4) -> PosedImages:
    """Images of a ball of `ball` times RADIUS about CENTRE that shines by itself, `across`^2 rays a pixel."""
    focal = 0.5 * size / np.tan(np.radians(FOV) / 2)
    poses = poses_about(directions, distance)
    count = len(poses)
    cameras = PosedImages(pixels=np.zeros((count, size, size, 4), np.float32), poses=poses,
                          focal=np.full((count, 2), focal), centre=np.full((count, 2), size / 2))
    row, column = (grid.ravel() for grid in np.mgrid[:size * across, :size * across])
    for number in range(count):
        origins, ways = cameras.rays(number, (column + 0.5) / across, (row + 0.5) / across)
        out = origins - np.array(CENTRE)
        middle = -(out * ways).sum(1)
        left = (ball * RADIUS) ** 2 - ((out + middle[:, None] * ways) ** 2).sum(1)
        hit = left > 0
        normal = (out + (middle - np.sqrt(np.maximum(left, 0)))[:, None] * ways) / (ball * RADIUS)
        fine = np.concatenate([colour(normal) * hit[:, None], hit[:, None]], axis=1)
        cameras.pixels[number] = fine.reshape(size, across, size, across, 4).mean(axis=(1, 3))
    return cameras


def fitted(images: PosedImages, held_out: PosedImages, settings: FieldSettings = SETTINGS, *, white: float = 1.0,
           checkpoint: Path | None = None, told=lambda progress: None) -> FieldFile:
    """A field of a ball."""
    return fit_field(images, held_out, settings, centre=CENTRE, radius=RADIUS, white=white, key="ball", clean=None,
                     checkpoint=checkpoint, told=told)


class Stopped(Exception):
    """A fit was interrupted."""


def stop_at(step: int):
    """Something to tell progress to that stops a fit after so many steps."""
    def told(progress: FitProgress) -> None:
        if progress.step >= step:
            raise Stopped
    return told
