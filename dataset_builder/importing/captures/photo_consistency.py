"""Whether photographs without masks see the same things at the same places, in each way that their matrices may be
meant."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.pose_readers.capture import Capture, problem
from dataset_builder.errors import UserError
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.importing.captures.photographs import Ball, Photograph, frame_size, photograph
from dataset_builder.importing.captures.silhouettes import meanings, nearest_point

VIEWS, SIZE = 16, 96
"""Images that are compared, and their longest side."""
REACH = 0.35
"""Radius of the ball about the point that cameras look at, in median distances from it."""
RAYS, DEPTHS, NEIGHBOURS = 60, 48, 3
"""Rays of an image, at its strongest edges; places along each; nearest cameras that are asked."""
BETTER = 0.75
"""Share of the difference as written below which another meaning is named."""


def mismatch(images: PosedImages, centre: np.ndarray, radius: float) -> float:
    """Mean difference of colours along rays through strong edges, each at the place where the nearest cameras agree
    best, over that if these had other cameras' photographs: near 1 where places agree by chance alone.

    That is plane sweeping (Collins 1996) along single rays. images: a few; centre, radius: of a ball that they look at.
    """
    pictures = np.sqrt(np.maximum(images.pixels[..., :3].astype(np.float32), 0))
    count, height, width = pictures.shape[:3]
    places, best = images.poses[:, :3, 3], np.zeros(2)
    for number, picture in enumerate(pictures):
        grey = picture.mean(axis=-1)
        edge = np.abs(np.gradient(grey, axis=0)) + np.abs(np.gradient(grey, axis=1))
        edge[[0, -1]] = edge[:, [0, -1]] = 0
        row, column = np.divmod(np.argsort(-edge.ravel(), kind="stable")[:RAYS * 4:4], width)
        origins, ways = images.rays(number, column + 0.5, row + 0.5)
        reach = (ways @ (centre - places[number]))[:, None] + radius * np.linspace(-1, 1, DEPTHS)
        points = origins[:, None] + reach[..., None] * ways[:, None]
        near = np.argsort(np.linalg.norm(places - places[number], axis=1), kind="stable")[1:NEIGHBOURS + 1]
        apart = np.zeros((2, *reach.shape))
        for other in near:
            local = (points - places[other]) @ images.poses[other, :3, :3]
            depth = np.maximum(local[..., 2], 1e-9)
            x, y = np.moveaxis(local[..., :2] / depth[..., None] * images.focal[other] + images.centre[other], -1, 0)
            x, y = (np.clip(each, -1, max(height, width)).astype(int) for each in (x, y))
            seen = (local[..., 2] > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
            for kind, shown in enumerate((other, (other + count // 2) % count)):
                found = pictures[shown, y.clip(0, height - 1), x.clip(0, width - 1)]
                apart[kind] += np.where(seen, np.abs(found - picture[row, column][:, None]).mean(axis=-1), 1.0)
        best += apart.min(axis=2).mean(axis=1)
    return float(best[0] / max(best[1], 1e-9))


def check_consistency(capture: Capture, ball: Ball | None, where: str | Path) -> float:
    """`mismatch` of a capture without masks. Raises UserError where its matrices are better taken for something else,
    and says for what."""
    images = _few(capture)
    if images is None:
        return 1.0
    as_written = mismatch(images, np.array(ball.centre), ball.radius) if ball else _about_focus(images, images.poses)
    others = {text: _about_focus(images, poses) for text, poses in meanings(images.poses, capture.layout).items()}
    text = min(others, key=lambda name: others[name])
    if others[text] < BETTER * as_written:
        raise problem(where, "expected photographs that see the same colours at the same places, got a difference of "
                      f"{as_written:.2f} of chance", f"{text}; with that it is {others[text]:.2f}")
    return as_written


def focus_of(poses: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """(3,) the point that (N, 4, 4) cameras look at, the radius of a ball about it, and (N,) whether each has it before
    itself."""
    focus = nearest_point(poses[:, :3, 3], poses[:, :3, 2])
    offsets = focus - poses[:, :3, 3]
    return focus, REACH * float(np.median(np.linalg.norm(offsets, axis=1))), np.einsum(
        "ij,ij->i", offsets, poses[:, :3, 2]) > 0


def _about_focus(images: PosedImages, poses: np.ndarray) -> float:
    focus, radius, _ = focus_of(poses)
    return mismatch(replace(images, poses=poses), focus, radius)


def _few(capture: Capture) -> PosedImages | None:
    """Some whole photographs, small; None where too few can be read, which is told elsewhere."""
    size = frame_size([shot.lens.size for shot in capture.shots], SIZE)
    taken = list[tuple[Photograph, np.ndarray]]()
    for index in np.unique(np.linspace(0, len(capture.shots) - 1, VIEWS).astype(int)):
        try:
            taken.append((photograph(capture.shots[index], size, None), capture.shots[index].pose))
        except UserError:
            continue
    if len(taken) <= NEIGHBOURS:
        return None
    return PosedImages(pixels=np.stack([each.pixels for each, _ in taken]), poses=np.stack([pose for _, pose in taken]),
                       focal=np.array([each.focal for each, _ in taken]),
                       centre=np.array([each.centre for each, _ in taken]))
