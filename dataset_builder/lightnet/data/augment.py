"""Which examples make up a batch, and how they are varied: cropped, mirrored, under more, less or other target light.

Light is additive, so that all that is seen under the target light, S', I_t and the harmonics, may be multiplied by one
factor per channel, and I_t = D S + spec holds as before. Mirror images are pictures of a mirrored world.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.seeding import rng

DRAWS = 8
"""Numbers drawn for an example in an epoch, whether they are used or not."""


class Draw(NamedTuple):
    """Example number `example` as epoch `epoch` shows it."""

    epoch: int
    example: int


@lru_cache(maxsize=4)
def epoch_order(count: int, seed: int, epoch: int) -> np.ndarray:
    """(count,) every position once, shuffled anew in each epoch; not to be written to."""
    order = rng(seed, "order", epoch).permutation(count)
    order.flags.writeable = False
    return order


def draws_of(batch: int, *, size: int, count: int, seed: int) -> list[Draw]:
    """Batch number `batch`: positions [batch size, (batch + 1) size) of all epochs in a row, so that none is ragged."""
    places = (divmod(place, count) for place in range(batch * size, (batch + 1) * size))
    return [Draw(epoch=epoch, example=int(epoch_order(count, seed, epoch)[place])) for epoch, place in places]


class Window(NamedTuple):
    """A rectangle of a picture, in pixels; it may reach beyond the right and the lower edge, where nothing is."""

    top: int
    left: int
    height: int
    width: int


@dataclass(frozen=True, kw_only=True)
class Variation:
    """How an example is varied."""

    mirrored: bool
    """Left for right."""
    gain: tuple[float, ...]
    """Factors of the target light in R, G and B."""
    place: tuple[float, float] = (0.5, 0.5)
    """Of the window, in [0, 1) from top to bottom and from left to right of what is possible."""
    pixel: float = 0.5
    """In [0, 1), which of the object's the window is put about."""


STILL = Variation(mirrored=False, gain=(1.0, 1.0, 1.0))
"""No variation."""


@lru_cache(maxsize=4)
def epoch_draws(count: int, seed: int, epoch: int) -> np.ndarray:
    """(count, DRAWS) uniform in [0, 1): a row for each example; not to be written to."""
    draws = rng(seed, "augment", epoch).uniform(size=(count, DRAWS))
    draws.flags.writeable = False
    return draws


def variation_of(spec: DataSpec, draws: np.ndarray) -> Variation:
    """The variation that (DRAWS,) numbers in [0, 1) stand for. What is switched off in `spec` moves nothing else."""
    mirror, stops, *colours, down, right, pixel = draws.tolist()
    strength = 2 ** (spec.exposure * (2 * stops - 1))
    return Variation(mirrored=spec.flips and mirror < 0.5, place=(down, right), pixel=pixel,
                     gain=tuple(strength * (1 + spec.colour * (2 * colour - 1)) for colour in colours))


def window_side(crop: int, height: int, width: int, *, multiple: int) -> int:
    """Side of the square that is cut from (height, width): at most `crop` and at most the picture, a multiple of
    `multiple`, and one `multiple` at least."""
    return max(min(crop, height, width) // multiple, 1) * multiple


def window_about(inside: np.ndarray, side: int, variation: Variation) -> Window:
    """A square in a picture, with the object in it: (H, W) bool, one pixel True at least.

    Along an axis that the object fits in it holds the whole object; along others it is put about one of its pixels.
    """
    if side >= max(inside.shape):
        return Window(top=0, left=0, height=side, width=side)
    spans = [np.flatnonzero(inside.any(axis=1 - axis)) for axis in (0, 1)]
    starts = [_start_with_all(int(span[0]), int(span[-1]) + 1, side, length, place)
              for span, length, place in zip(spans, inside.shape, variation.place, strict=True)]
    if None in starts:
        pixels = np.flatnonzero(inside)
        pixel = divmod(int(pixels[int(variation.pixel * len(pixels))]), inside.shape[1])
        starts = [min(max(at - side // 2, 0), length - side) if start is None else start
                  for start, at, length in zip(starts, pixel, inside.shape, strict=True)]
    top, left = (start or 0 for start in starts)
    return Window(top=top, left=left, height=side, width=side)


def _start_with_all(low: int, high: int, side: int, length: int, place: float) -> int | None:
    """Where a stretch of `side` starts that holds [low, high) and lies in [0, length); None where it would not fit."""
    if high - low > side:
        return None
    first, last = max(high - side, 0), max(min(low, length - side), 0)
    return first + int(place * (last - first + 1))
