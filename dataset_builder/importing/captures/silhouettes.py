"""Whether cameras and masks belong together: the visual hull of the masks must fill them again.

Wrong axes, cameras given the other way round, and inverted masks empty the hull or leave a piece of it. What would make
it whole is tried, and named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.geometry.visual_hull import visual_hull
from dataset_builder.importing.captures.photographs import IN, Ball

VIEWS, PIXELS, CELLS, STEPS = 16, 40, 40, 72
"""Images that are compared, longest side of their masks, cells along a side of the hull, and places along a ray."""
ENOUGH, CLEAR, LEAST = 0.9, 0.1, 0.8
"""IoU of the hull's silhouette and the masks that is right; how much better a convention must be to be named below
that; and what is refused though none is."""
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
TO_WORLD, TO_CAMERA = "camera-to-world", "world-to-camera"
MATRICES = {"COLMAP": (TO_CAMERA, "OpenCV"), "transforms.json": (TO_WORLD, "OpenGL"),
            "ActorsHQ": (TO_WORLD, "OpenCV")}
"""What matrices of each layout are, and whose axes their cameras have."""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How well cameras and masks agree."""

    iou: float
    """Of the hull's silhouette and the masks, sum over images; 1 is perfect."""
    ball: Ball | None
    """About all that the masks show; None where rays through the masks meet nowhere before the cameras."""
    remedy: str = ""
    """What would make it better, or ""."""
    better: float = 0.0
    """IoU with that."""


def agreement(images: PosedImages, layout: str) -> Agreement:
    """Of a few images with masks, see `few_of`; where they disagree, what the matrices of a capture of this layout may
    be is tried."""
    iou, ball = _score(images)
    if iou >= ENOUGH:
        return Agreement(iou=iou, ball=ball)
    tried = {text: _score(other)[0] for text, other in _remedies(images, layout).items()}
    text = max(tried, key=lambda name: tried[name])
    good = tried[text] >= max(LEAST, iou + CLEAR)
    return Agreement(iou=iou, ball=ball, remedy=text if good else "", better=tried[text] if good else 0.0)


def _remedies(images: PosedImages, layout: str) -> dict[str, PosedImages]:
    """What to do, and the images after that."""
    inverted = images.pixels.copy()
    inverted[..., 3] = 1 - inverted[..., 3]
    others = {text: replace(images, poses=poses) for text, poses in meanings(images.poses, layout).items()}
    return {**others,
            "mirror the images left to right, or negate x of the camera axes": replace(
                images, poses=images.poses @ np.diag([-1.0, 1, 1, 1])),
            "mirror the images top to bottom, or negate y of the camera axes": replace(
                images, poses=images.poses @ np.diag([1.0, -1, 1, 1])),
            "invert the masks: white is to be the object": replace(images, pixels=inverted)}


def meanings(poses: np.ndarray, layout: str) -> dict[str, np.ndarray]:
    """What the matrices of a capture of a layout may be instead, and the poses (N, 4, 4) that follow."""
    wanted = MATRICES[layout]
    written = _matrices(poses, wanted)
    return {f"the matrices are {way} with {axes}'s axes, where {layout} has {' with '.join(wanted)}'s axes; convert "
            "them": _poses(written, (way, axes))
            for way in (TO_WORLD, TO_CAMERA) for axes in ("OpenCV", "OpenGL") if (way, axes) != wanted}


def _matrices(poses: np.ndarray, kind: tuple[str, str]) -> np.ndarray:
    """What is written for poses `frame_from_camera` of OpenCV's axes."""
    written = poses if kind[1] == "OpenCV" else poses @ FLIP
    return written if kind[0] == TO_WORLD else np.linalg.inv(written)


def _poses(written: np.ndarray, kind: tuple[str, str]) -> np.ndarray:
    """`_matrices` undone."""
    poses = written if kind[0] == TO_WORLD else np.linalg.inv(written)
    return poses if kind[1] == "OpenCV" else poses @ FLIP


def few_of(images: PosedImages, usable: Sequence[int]) -> PosedImages:
    """A few of the images of some indices, evenly chosen, with opacity alone at a small size, 0 or 1."""
    chosen = np.array(usable)[np.unique(np.linspace(0, len(usable) - 1, VIEWS).astype(int))]
    height, width = images.pixels.shape[1:3]
    step = max(1, -(-max(height, width) // PIXELS))
    rows, columns = height // step, width // step
    masks = np.stack([images.pixels[k, :rows * step, :columns * step, 3].astype(np.float32).reshape(
        rows, step, columns, step).mean(axis=(1, 3)) for k in chosen])
    pixels = np.zeros((*masks.shape, 4), np.float32)
    pixels[..., 3] = masks >= IN
    return PosedImages(pixels=pixels, poses=images.poses[chosen], focal=images.focal[chosen] / step,
                       centre=images.centre[chosen] / step)


def _score(images: PosedImages) -> tuple[float, Ball | None]:
    """IoU of the hull's silhouette and the masks, and the ball about the hull; 0 and None without a hull."""
    ball = ball_of(images)
    ball = ball and _about(hull_of(images, ball, slack=1.0), ball)
    if ball is None:
        return 0.0, None
    hull = hull_of(images, ball)
    meets = joined = 0
    for number in range(len(images.pixels)):
        mask = images.pixels[number, ..., 3] >= IN
        shown = _shown(images, number, hull, ball)
        meets, joined = meets + int((mask & shown).sum()), joined + int((mask | shown).sum())
    return meets / max(joined, 1), ball


def rays_of_image(images: PosedImages, number: int) -> np.ndarray:
    """(H, W, 3) unit directions through the middles of an image's pixels."""
    height, width = images.pixels.shape[1:3]
    rows, columns = np.divmod(np.arange(height * width), width)
    return images.rays(number, columns + 0.5, rows + 0.5)[1].reshape(height, width, 3)


def nearest_point(origins: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """(3,) point with the least sum of squared distances to lines through (N, 3) origins along (N, 3) unit ways."""
    across = np.eye(3) - ways[:, :, None] * ways[:, None]
    # A little weight on the origins' mean, where all lines are parallel
    left = across.sum(axis=0) + 1e-9 * np.eye(3)
    return np.linalg.solve(left, np.einsum("nij,nj->i", across, origins) + 1e-9 * origins.mean(axis=0))


def ball_of(images: PosedImages) -> Ball | None:
    """A ball that holds what the masks show: its middle where rays through theirs meet, its radius that of the widest
    mask, stray specks and all. None where rays meet behind most cameras, or masks are empty."""
    full = [k for k in range(len(images.pixels)) if (images.pixels[k, ..., 3] >= IN).any()]
    if len(full) < 2:
        return None
    rays = [rays_of_image(images, k)[images.pixels[k, ..., 3] >= IN] for k in full]
    middles = np.stack([each.mean(axis=0) / np.linalg.norm(each.mean(axis=0)) for each in rays])
    origins = images.poses[full, :3, 3]
    centre = nearest_point(origins, middles)
    offsets = centre - origins
    if np.median(np.einsum("ij,ij->i", offsets, middles)) <= 0:
        return None
    reach = [np.linalg.norm(offset - (each @ offset)[:, None] * each, axis=-1).max()
             for offset, each in zip(offsets, rays, strict=True)]
    return _ball(centre, float(max(reach))) if max(reach) > 0 else None


def _ball(centre: np.ndarray, radius: float) -> Ball:
    return Ball(centre=(float(centre[0]), float(centre[1]), float(centre[2])), radius=radius)


def _about(hull: np.ndarray, ball: Ball) -> Ball | None:
    """The ball about the middle of a hull's box and all of its cells."""
    cells = np.argwhere(hull)[:, ::-1]
    if not len(cells):
        return None
    middle = (cells.min(axis=0) + cells.max(axis=0)) / 2
    reach = np.linalg.norm(cells - middle, axis=1).max()
    cell = 2 * ball.radius / CELLS
    return _ball(np.array(ball.centre) + ((middle + 0.5) * cell - ball.radius), float(reach * cell))


def hull_of(images: PosedImages, ball: Ball, slack: float = 0.0) -> np.ndarray:
    """(CELLS, CELLS, CELLS) bool by z, y, x: cells whose middle every image that has it in its frame shows within its
    mask, give or take `slack` pixels and as many halves of a cell."""
    return visual_hull(images, np.arange(len(images.pixels)), CELLS, centre=np.array(ball.centre), radius=ball.radius,
                       slack=slack, whole=slack)


def _shown(images: PosedImages, number: int, hull: np.ndarray, ball: Ball) -> np.ndarray:
    """(H, W) bool: pixels whose rays meet the hull."""
    rays = rays_of_image(images, number)
    offset = np.array(ball.centre) - images.poses[number, :3, 3]
    along = rays @ offset
    reach = along[..., None] + ball.radius * 3**0.5 * np.linspace(-1, 1, STEPS)
    places = (rays[..., None, :] * reach[..., None] - offset) / ball.radius
    cells = np.floor((places + 1) * CELLS / 2).astype(int)
    within = ((cells >= 0) & (cells < CELLS)).all(axis=-1) & (reach > 0)
    x, y, z = np.moveaxis(cells.clip(0, CELLS - 1), -1, 0)
    return np.asarray((hull[z, y, x] & within).any(axis=-1))
