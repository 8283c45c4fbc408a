"""Whether cameras and masks belong together: the visual hull of the masks must fill them again.

Wrong axes, cameras given the other way round, and inverted masks empty the hull or leave a piece of it. What would make
it whole is tried, and named.
"""

from dataclasses import dataclass

import numpy as np

from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.importing.captures.photographs import IN, Ball

VIEWS, PIXELS, CELLS, STEPS = 24, 48, 48, 96
"""Images that are compared, longest side of their masks, cells along a side of the hull, and places along a ray."""
ENOUGH, CLEAR, LEAST = 0.9, 0.1, 0.7
"""IoU of the hull's silhouette and the masks that is right; how much better a convention must be to be named below
that; and what is refused though none is."""
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


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


def agreement(images: PosedImages) -> Agreement:
    """Of images with masks; where they disagree, the likely conventions are tried."""
    images = few_of(images)
    iou, ball = _score(images)
    if iou >= ENOUGH:
        return Agreement(iou=iou, ball=ball)
    tried = {text: _score(other)[0] for text, other in _conventions(images).items()}
    text = max(tried, key=lambda name: tried[name])
    good = tried[text] >= max(LEAST, iou + CLEAR)
    return Agreement(iou=iou, ball=ball, remedy=text if good else "", better=tried[text] if good else 0.0)


def _conventions(images: PosedImages) -> dict[str, PosedImages]:
    """What to do, and the images after that."""
    def with_poses(poses: np.ndarray) -> PosedImages:
        return PosedImages(pixels=images.pixels, poses=poses, focal=images.focal, centre=images.centre)

    poses, inverse = images.poses, np.linalg.inv(images.poses)
    inverted = images.pixels.copy()
    inverted[..., 3] = 1 - inverted[..., 3]
    return {
        "negate y and z of the camera axes: they are OpenGL's where OpenCV's were expected, or the other way round":
            with_poses(poses @ FLIP),
        "invert the poses: they are world-to-camera where camera-to-world was expected, or the other way round":
            with_poses(inverse),
        "invert the poses and negate y and z of the camera axes: they are OpenGL's world-to-camera, or the other way "
        "round": with_poses(inverse @ FLIP),
        "negate y and z of the camera axes, then invert the poses: they are of the other convention and the other way "
        "round": with_poses(FLIP @ inverse),
        "mirror the images left to right, or negate x of the camera axes": with_poses(poses @ np.diag([-1.0, 1, 1, 1])),
        "mirror the images top to bottom, or negate y of the camera axes": with_poses(poses @ np.diag([1.0, -1, 1, 1])),
        "invert the masks: white is to be the object": PosedImages(
            pixels=inverted, poses=poses, focal=images.focal, centre=images.centre),
    }


def few_of(images: PosedImages) -> PosedImages:
    """A few images, evenly chosen, with opacity alone at a small size."""
    chosen = np.unique(np.linspace(0, len(images.pixels) - 1, VIEWS).astype(int))
    height, width = images.pixels.shape[1:3]
    step = max(1, -(-max(height, width) // PIXELS))
    rows, columns = height // step, width // step
    masks = np.stack([images.pixels[k, :rows * step, :columns * step, 3].astype(np.float32).reshape(
        rows, step, columns, step).mean(axis=(1, 3)) for k in chosen])
    pixels = np.zeros((*masks.shape, 4), np.float32)
    pixels[..., 3] = masks
    return PosedImages(pixels=pixels, poses=images.poses[chosen], focal=images.focal[chosen] / step,
                       centre=images.centre[chosen] / step)


def _score(images: PosedImages) -> tuple[float, Ball | None]:
    """IoU of the hull's silhouette and the masks, and the ball about the hull; 0 and None without a hull."""
    ball = ball_of(images)
    if ball is None:
        return 0.0, None
    hull = hull_of(images, ball)
    meets = joined = 0
    for number in range(len(images.pixels)):
        mask = images.pixels[number, ..., 3] >= IN
        shown = _shown(images, number, hull, ball)
        meets, joined = meets + int((mask & shown).sum()), joined + int((mask | shown).sum())
    return meets / max(joined, 1), ball


def _rays(images: PosedImages, number: int) -> np.ndarray:
    """(H, W, 3) unit directions through the middles of an image's pixels."""
    height, width = images.pixels.shape[1:3]
    x = (np.arange(width) + 0.5 - images.centre[number, 0]) / images.focal[number, 0]
    y = (np.arange(height)[:, None] + 0.5 - images.centre[number, 1]) / images.focal[number, 1]
    ways = np.stack(np.broadcast_arrays(x, y, 1.0), axis=-1) @ images.poses[number, :3, :3].T
    return ways / np.linalg.norm(ways, axis=-1, keepdims=True)


def nearest_point(origins: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """(3,) point with the least sum of squared distances to lines through (N, 3) origins along (N, 3) unit ways."""
    across = np.eye(3) - ways[:, :, None] * ways[:, None]
    # A little weight on the origins' mean, where all lines are parallel
    left = across.sum(axis=0) + 1e-9 * np.eye(3)
    return np.linalg.solve(left, np.einsum("nij,nj->i", across, origins) + 1e-9 * origins.mean(axis=0))


def ball_of(images: PosedImages) -> Ball | None:
    """The ball about what the masks show: its middle where rays through theirs meet, its radius that of the widest
    mask. None where rays meet behind most cameras, or masks are empty."""
    full = [k for k in range(len(images.pixels)) if (images.pixels[k, ..., 3] >= IN).any()]
    if len(full) < 2:
        return None
    rays = [_rays(images, k)[images.pixels[k, ..., 3] >= IN] for k in full]
    middles = np.stack([each.mean(axis=0) / np.linalg.norm(each.mean(axis=0)) for each in rays])
    origins = images.poses[full, :3, 3]
    centre = nearest_point(origins, middles)
    offsets = centre - origins
    if np.median(np.einsum("ij,ij->i", offsets, middles)) <= 0:
        return None
    reach = [np.linalg.norm(offset - (each @ offset)[:, None] * each, axis=-1).max()
             for offset, each in zip(offsets, rays, strict=True)]
    radius = float(np.percentile(reach, 90)) * 1.05
    return Ball(centre=(float(centre[0]), float(centre[1]), float(centre[2])), radius=radius) if radius > 0 else None


def hull_of(images: PosedImages, ball: Ball) -> np.ndarray:
    """(CELLS, CELLS, CELLS) by x, y, z: cells whose middle every image that has it in its frame shows within its
    mask."""
    axis = (np.arange(CELLS) + 0.5) * 2 / CELLS - 1
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.array(ball.centre) + ball.radius * points
    alive, height, width = np.arange(len(points)), *images.pixels.shape[1:3]
    unseen = np.ones(len(points), bool)
    for number in range(len(images.pixels)):
        x, y, z = ((points[alive] - images.poses[number, :3, 3]) @ images.poses[number, :3, :3]).T
        before = z > 1e-9
        z = np.where(before, z, 1.0)
        column = np.floor(np.clip(x / z * images.focal[number, 0] + images.centre[number, 0], -1, width)).astype(int)
        row = np.floor(np.clip(y / z * images.focal[number, 1] + images.centre[number, 1], -1, height)).astype(int)
        framed = before & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        unseen[alive[framed]] = False
        mask = images.pixels[number, row.clip(0, height - 1), column.clip(0, width - 1), 3] >= IN
        alive = alive[~framed | mask]
    hull = np.zeros(len(points), bool)
    hull[alive] = True
    return (hull & ~unseen).reshape(CELLS, CELLS, CELLS)


def _shown(images: PosedImages, number: int, hull: np.ndarray, ball: Ball) -> np.ndarray:
    """(H, W) bool: pixels whose rays meet the hull."""
    rays = _rays(images, number)
    offset = np.array(ball.centre) - images.poses[number, :3, 3]
    along = rays @ offset
    reach = along[..., None] + ball.radius * 3**0.5 * np.linspace(-1, 1, STEPS)
    places = (rays[..., None, :] * reach[..., None] - offset) / ball.radius
    cells = np.floor((places + 1) * CELLS / 2).astype(int)
    within = ((cells >= 0) & (cells < CELLS)).all(axis=-1) & (reach > 0)
    x, y, z = np.moveaxis(cells.clip(0, CELLS - 1), -1, 0)
    return np.asarray((hull[x, y, z] & within).any(axis=-1))
