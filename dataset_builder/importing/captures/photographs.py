"""A photograph to linear pixels of a pinhole camera: decoded, cut to what it is of, undistorted, averaged."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.image_maps import ImageFile, limited_size, opened_image
from dataset_builder.assets.linear_texels import reduced
from dataset_builder.assets.pose_readers.capture import CaptureShot, Lens, problem
from dataset_builder.digest import read_regular, sha256_bytes
from dataset_builder.errors import Problem, UserError
from dataset_builder.tonemap import LUMINANCE

MOST_BYTES = 1 << 30
FINER = 4
"""An image is decoded at up to so many times the working size, and what is cut out of it is sampled as often."""
MARGIN = 0.08
"""Kept around a mask, in its lengths."""
IN = 0.5
"""Mask from which a pixel is the object's."""
LEAST, MOST = 0.01, 0.9
"""Shares of the frame that a mask may have."""
COVER_SIDE = 256
"""Side that coverage is looked at with, pixels."""
BORDER = 24
"""Places along each side of a window that are looked at."""
SHRINK = 0.97


@dataclass(frozen=True, kw_only=True, eq=False)
class Photograph:
    """What was made of one shot."""

    pixels: np.ndarray
    """(H, W, 4) float32: linear radiance times opacity, and opacity."""
    focal: tuple[float, float]
    """Along x and y, pixels."""
    centre: tuple[float, float]
    """Principal point x, y, pixels."""
    share: float
    """Of the whole frame that the object takes."""
    sha256: str
    """Of the files of image and mask."""


@dataclass(frozen=True, kw_only=True)
class Ball:
    """A ball in the capture's own frame and units."""

    centre: tuple[float, float, float]
    radius: float
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    """Lowest and highest corner of the box in it that is meant, if not all of it."""


def header_of(image: Path) -> tuple[tuple[int, int], bool]:
    """(width, height) and whether there is coverage, from the image's header. Raises UserError."""
    with opened_image(ImageFile(name=str(image), content=image)) as opened:
        return opened.size, bool(opened.has_transparency_data)


def is_covered(image: Path) -> bool:
    """Whether an image has coverage that is not 1 everywhere. Raises UserError where it cannot be read."""
    if not header_of(image)[1]:
        return False
    return bool(_decoded(image, COVER_SIDE, srgb=False)[0][..., 3].min() < 1)


def frame_size(sizes: list[tuple[int, int]], long: int) -> tuple[int, int]:
    """(width, height) of working images, the longer side `long`: of the images' shape, or square where they differ."""
    shapes = [width / height for width, height in sizes]
    if max(shapes) > 1.01 * min(shapes):
        return long, long
    return limited_size((long, round(long / shapes[0])) if shapes[0] >= 1 else (round(long * shapes[0]), long), long)


def photograph(shot: CaptureShot, size: tuple[int, int], ball: Ball | None) -> Photograph:
    """The pixels of a shot at (width, height) `size`: the window around its mask, or where there is none around the
    ball, outside of which nothing is opaque; all of the frame where that is larger.

    sRGB is undone before anything is averaged. The lens is undone by bilinear look-ups, several for a pixel. Raises
    UserError for files that cannot be read and masks that are no masks.
    """
    image, seal = _decoded(shot.image, FINER * max(size), srgb=True)
    lens = shot.lens.scaled((image.shape[1], image.shape[0]))
    if shot.mask is not None:
        mask, other = _decoded(shot.mask, FINER * max(size), srgb=False)
        # Grey masks are white where the object is; those with alpha, as background removers save, opaque
        image[..., 3] = np.where(mask[..., 3].min() < IN, mask[..., 3], mask[..., 0])
        seal = sha256_bytes(f"{seal}{other}".encode())
    elif ball is not None and image[..., 3].min() >= IN:
        image[..., 3] = _inside(shot, lens, ball)
    image[..., :3] *= image[..., 3:]
    covered = image[..., 3] >= IN
    window = _window(covered, lens, size)
    pixels = _cut(image, lens, window, size)
    left, top, width, height = window
    scale = size[0] / width, size[1] / height
    return Photograph(
        pixels=pixels, share=float(covered.mean()), sha256=seal,
        focal=(lens.focal[0] * scale[0], lens.focal[1] * scale[1]),
        centre=((lens.centre[0] - left) * scale[0], (lens.centre[1] - top) * scale[1]))


def _decoded(path: Path, most: int, *, srgb: bool) -> tuple[np.ndarray, str]:
    """(H, W, 4) float32 linear colours and coverage with sides of at most `most` pixels, and the file's SHA-256."""
    try:
        content = read_regular(path, most=MOST_BYTES)
    except OSError as error:
        raise problem(path, f"expected a readable image, got: {error.strerror or error}", "put it back") from error
    image = ImageFile(name=str(path), content=content)
    with opened_image(image) as opened:
        opened.load()
        return reduced(opened, limited_size(opened.size, most), srgb=srgb, opaque=False), sha256_bytes(content)


def rays_of(shot: CaptureShot, lens: Lens, pixels: np.ndarray) -> np.ndarray:
    """(..., 3) unit directions in the capture's frame through (..., 2) pixels."""
    ways = lens.ways(pixels)
    ways = np.concatenate([ways, np.ones_like(ways[..., :1])], axis=-1)
    return (ways / np.linalg.norm(ways, axis=-1, keepdims=True)) @ shot.pose[:3, :3].T


def _inside(shot: CaptureShot, lens: Lens, ball: Ball) -> np.ndarray:
    """(H, W) whether pixels see the ball, or the box in it."""
    width, height = lens.size
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = rays_of(shot, lens, np.stack([columns, rows], axis=-1))
    offset = np.array(ball.centre) - shot.pose[:3, 3]
    if ball.box is not None:
        # Where rays are between both planes of all three pairs (Kay and Kajiya 1986)
        rays = np.where(rays == 0, 1e-12, rays)
        ends = np.sort((np.array(ball.box)[:, None, None] - shot.pose[:3, 3]) / rays, axis=0)
        return (np.maximum(ends[0].max(axis=-1), 0) < ends[1].min(axis=-1)).astype(np.float32)
    along = rays @ offset
    return ((offset @ offset - along**2 <= ball.radius**2) & (along > 0)).astype(np.float32)


def _window(covered: np.ndarray, lens: Lens, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """(left, top, width, height) of what is cut out, in pixels of an undistorted image with the same focal lengths: of
    the shape of `size`, about the object, and nowhere without an image."""
    width, height = lens.size
    rows, columns = np.flatnonzero(covered.any(axis=1)), np.flatnonzero(covered.any(axis=0))
    box = np.array([[0, 0], [width, height]]) if not len(rows) else np.array([[columns[0], rows[0]],
                                                                             [columns[-1] + 1, rows[-1] + 1]])
    seen = _straight(lens, _border(box[0], box[1]))
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, extent = (low + high) / 2, (1 + 2 * MARGIN) * (high - low) + 2
    wide = min(max(extent[0], extent[1] * size[0] / size[1]), width, height * size[0] / size[1])
    while True:
        whole = np.array([wide, wide * size[1] / size[0]])
        start = np.clip(middle - whole / 2, 0, [width - whole[0], height - whole[1]])
        ways = (_border(start, start + whole) - np.array(lens.centre)) / lens.focal
        places = lens.pixels(ways)
        if ((places >= -0.5) & (places <= np.array([width, height]) + 0.5)).all() or wide < width / 10:
            return float(start[0]), float(start[1]), float(whole[0]), float(whole[1])
        wide *= SHRINK
        middle += (1 - SHRINK) * (np.array(lens.centre) - middle)


def _straight(lens: Lens, pixels: np.ndarray) -> np.ndarray:
    """Where pixels of an image are in the undistorted one."""
    return lens.ways(pixels) * lens.focal + lens.centre


def _border(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(N, 2) places along the sides of a box."""
    along, still = np.linspace(0, 1, BORDER), np.zeros(BORDER)
    shares = np.concatenate([np.stack(pair, axis=-1) for pair in (
        (along, still), (along, still + 1), (still, along), (still + 1, along))])
    return low + shares * (high - low)


def _cut(image: np.ndarray, lens: Lens, window: tuple[float, float, float, float], size: tuple[int, int]) -> np.ndarray:
    from scipy.ndimage import map_coordinates

    left, top, width, height = window
    finer = int(np.clip(np.ceil(width / size[0]), 1, FINER))
    columns = left + (np.arange(finer * size[0]) + 0.5) * width / (finer * size[0])
    rows = top + (np.arange(finer * size[1]) + 0.5) * height / (finer * size[1])
    places = np.stack(np.meshgrid(columns, rows), axis=-1)
    where = lens.pixels((places - np.array(lens.centre)) / lens.focal) - 0.5
    cut = np.stack([map_coordinates(image[..., channel], [where[..., 1], where[..., 0]], order=1, mode="nearest")
                    for channel in range(4)], axis=-1)
    return cut.reshape(size[1], finer, size[0], finer, 4).mean(axis=(1, 3)).astype(np.float32)


def sharpness(pixels: np.ndarray) -> float:
    """Variance of the Laplacian of encoded luminance within the mask, over the variance of that luminance: high for a
    sharp image, low for a blurred one; 0 where nothing is seen."""
    from scipy.ndimage import binary_erosion, laplace

    inside = binary_erosion(pixels[..., 3] > 1 - 1 / 64, iterations=2)
    values = np.sqrt(np.maximum(pixels[..., :3] @ LUMINANCE.astype(np.float32), 0))
    return float(laplace(values)[inside].var() / (values[inside].var() + 1e-6)) if inside.sum() > 16 else 0.0


def median_luminance(pixels: np.ndarray) -> float:
    """Median linear luminance of the opaque pixels; 0 where there are none."""
    inside = pixels[..., 3] >= IN
    return float(np.median(pixels[inside][:, :3] @ LUMINANCE / pixels[inside][:, 3])) if inside.any() else 0.0


def file_faults(shot: CaptureShot) -> list[Problem]:
    """What is wrong with a shot's files, as far as headers tell."""
    gone = [path for path in (shot.image, shot.mask) if path is not None and not os.path.exists(path)]
    if gone:
        return [Problem(where=str(path), path="", rule="expected a file that the capture names, found none",
                        hint="put it back; capital letters count, in endings too") for path in gone]
    try:
        (width, height), _ = header_of(shot.image)
        mask = header_of(shot.mask)[0] if shot.mask else (width, height)
    except UserError as error:
        return list(error.problems)
    known, faults = shot.lens.size, []
    if min(known) <= 0:
        return [Problem(where=f"{shot.image}: camera", path="", rule="expected an image size above 0, got "
                        f"{known[0]} x {known[1]}", hint="calibrate it again")]
    if abs(width * known[1] - height * known[0]) > known[0] + known[1]:
        hint = ("it was turned after calibration; turn it back" if (height, width) == known else
                "take the images that were calibrated, neither cropped nor padded")
        faults.append(Problem(where=str(shot.image), path="", hint=hint, rule="expected an image of the calibration's "
                              f"shape, {known[0]} x {known[1]}, got {width} x {height}"))
    if mask != (width, height):
        faults.append(Problem(where=str(shot.mask), path="", hint="make it from this image, at its size",
                              rule=f"expected a mask of the image's size, {width} x {height}, got "
                              f"{mask[0]} x {mask[1]}"))
    return faults


def boxed(corners: Sequence[float]) -> Ball:
    """The ball about the box between two opposite corners, x, y, z of each. Raises UserError for one without volume."""
    low, high = np.minimum(corners[:3], corners[3:]).tolist(), np.maximum(corners[:3], corners[3:]).tolist()
    if not all(a < b for a, b in zip(low, high, strict=True)):
        raise problem("", f"expected two opposite corners of a box, got {', '.join(f'{each:g}' for each in corners)}",
                      path="--box")
    middle, radius = np.add(low, high) / 2, float(np.linalg.norm(np.subtract(high, low)) / 2)
    return Ball(centre=(middle[0], middle[1], middle[2]), radius=radius,
                box=((low[0], low[1], low[2]), (high[0], high[1], high[2])))
