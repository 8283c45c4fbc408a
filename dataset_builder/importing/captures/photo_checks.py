"""What can be said of photographs among each other: exposures that drift, and blurred ones."""

import numpy as np

from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.importing.captures.photographs import Ball
from dataset_builder.importing.captures.silhouettes import CELLS, hull_of
from dataset_builder.tonemap import LUMINANCE

LOW, HIGH = 0.8, 1.25
"""Gains of single images from which exposures count as drifting, and are evened."""
POINTS, FEWEST_POINTS, MOST_VALUES = 1500, 300, 3_000_000
"""Places of the hull that are compared: fewer where many images see them, so that memory stays bounded."""
SEEN, ROUNDS = 4, 6
"""Images that must see a place, and places that an image must see; rounds of medians."""
DARK, CLIPPED = 1 / 512, 0.95
"""Linear values that say nothing about exposure: noise, and white."""
BLURRED, NEIGHBOURS, MOST_DROPPED = 0.35, 6, 0.2
"""An image is blurred below this share of the median sharpness of so many neighbours; at most so many are dropped."""


def gains(images: PosedImages, ball: Ball, few: PosedImages) -> np.ndarray:
    """(N,) exposure of each image over the usual one, from places of the visual hull of `few` images that several of
    all images see; 1 where an image sees too little.

    log value = log of the place + log gain, solved by alternating medians: surfaces that shine, and places where the
    hull is not the object, are outliers.
    """
    hull = hull_of(few, ball)
    places = _surface(hull, ball, int(np.clip(MOST_VALUES / len(images.pixels), FEWEST_POINTS, POINTS)))
    if not len(places):
        return np.ones(len(images.pixels))
    values = np.stack([_values(images, number, places, hull, ball) for number in range(len(images.pixels))], axis=1)
    values = values[np.isfinite(values).sum(axis=1) >= SEEN]
    told = np.isfinite(values).sum(axis=0) >= SEEN
    values, found = values[:, told], np.zeros(int(told.sum()))
    values = values[np.isfinite(values).any(axis=1)]
    if not values.size:
        return np.ones(len(images.pixels))
    for _ in range(ROUNDS):
        found = np.nanmedian(values - np.nanmedian(values - found, axis=1, keepdims=True), axis=0)
        found -= np.median(found)
    whole = np.ones(len(images.pixels))
    whole[told] = np.exp(found)
    return whole


def drifting(found: np.ndarray) -> bool:
    """Whether gains are so far apart that images are to be evened."""
    return bool(found.min() < LOW or found.max() > HIGH)


def _surface(hull: np.ndarray, ball: Ball, most: int) -> np.ndarray:
    """(P, 3) middles of cells of the hull beside empty ones, at most so many, evenly chosen."""
    padded = np.pad(hull, 1)
    buried = np.ones_like(hull)
    for axis in range(3):
        for step in (-1, 1):
            buried &= np.roll(padded, step, axis)[1:-1, 1:-1, 1:-1]
    cells = np.argwhere(hull & ~buried)[:, ::-1]
    cells = cells[np.unique(np.linspace(0, max(len(cells) - 1, 0), min(most, len(cells))).astype(int))]
    return np.array(ball.centre) + ball.radius * ((cells + 0.5) * 2 / CELLS - 1)


def _values(images: PosedImages, number: int, places: np.ndarray, hull: np.ndarray, ball: Ball) -> np.ndarray:
    """(P,) float32 logarithms of the luminance that an image shows of places, NaN where it does not see one well."""
    height, width = images.pixels.shape[1:3]
    origin = images.poses[number, :3, 3]
    x, y, z = ((places - origin) @ images.poses[number, :3, :3]).T
    before = z > 1e-9
    z = np.where(before, z, 1.0)
    column = np.floor(np.clip(x / z * images.focal[number, 0] + images.centre[number, 0], -1, width)).astype(int)
    row = np.floor(np.clip(y / z * images.focal[number, 1] + images.centre[number, 1], -1, height)).astype(int)
    framed = before & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    way = origin - places
    cell = 2 * ball.radius / CELLS
    steps = cell * np.arange(2, CELLS)
    path = places[:, None] + steps[:, None] * (way / np.linalg.norm(way, axis=1, keepdims=True))[:, None]
    cells = np.floor(((path - ball.centre) / ball.radius + 1) * CELLS / 2).astype(int)
    within = ((cells >= 0) & (cells < CELLS)).all(axis=-1)
    a, b, c = np.moveaxis(cells.clip(0, CELLS - 1), -1, 0)
    open_way = ~(hull[c, b, a] & within).any(axis=-1)
    pixels = np.asarray(images.pixels[number], np.float32)[row.clip(0, height - 1), column.clip(0, width - 1)]
    light = pixels[:, :3] @ LUMINANCE.astype(np.float32)
    good = framed & open_way & (pixels[:, 3] > 0.98) & (light > DARK) & (pixels[:, :3].max(axis=1) < CLIPPED)
    return np.where(good, np.log(np.maximum(light, DARK)), np.nan).astype(np.float32)


def blurred(sharp: np.ndarray, poses: np.ndarray, centre: np.ndarray) -> list[int]:
    """Indices of images with much less detail than those taken from nearest by; sharp: (N,) as `photographs.sharpness`
    gives it."""
    ways = poses[:, :3, 3] - centre
    ways = ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)
    found = []
    for number, way in enumerate(ways):
        away = -(ways @ way)
        away[number] = np.inf
        usual = np.median(sharp[np.argpartition(away, NEIGHBOURS)[:NEIGHBOURS]])
        if sharp[number] < BLURRED * usual:
            found.append((float(sharp[number] / usual), number))
    return sorted(number for _, number in sorted(found)[:int(MOST_DROPPED * len(sharp))])
