"""Examples as 8-bit pictures, mapped as networks and metrics see them, so that looks agree with scores."""

from collections.abc import Callable, Mapping

import numpy as np
import torch

from dataset_builder.lightnet.data.batch import Batch, Prediction
from dataset_builder.lightnet.data.ranges import inside_only, tone_map
from dataset_builder.tonemap import to_8bit

MARGIN = 4
"""Pixels about the object that stay."""
GAIN = 4
"""Factor of differences."""

Mapped = Callable[[torch.Tensor], np.ndarray]


def light(linear: torch.Tensor) -> np.ndarray:
    """(H, W, 3) uint8 of (3, H, W) exposed linear light, tone-mapped."""
    return _to_8bit(tone_map(linear))


def reflectance(values: torch.Tensor) -> np.ndarray:
    """(H, W, 3) uint8 of (3, H, W) reflectances in [0, 1], sRGB-encoded."""
    return to_8bit(values.detach().cpu().permute(1, 2, 0).numpy())


def signed(values: torch.Tensor) -> np.ndarray:
    """(H, W, 3) uint8 of (3, H, W) values about 0, which is mid-grey; -1 is black, 1 is white."""
    return _to_8bit((1 + values) / 2)


def difference(one: torch.Tensor, other: torch.Tensor) -> np.ndarray:
    """(H, W, 3) uint8 of `GAIN` times the distance of (3, H, W) exposed linear lights, each tone-mapped first."""
    return _to_8bit(GAIN * (tone_map(one).clamp(0, 1) - tone_map(other).clamp(0, 1)).abs())


PARTS: Mapping[str, tuple[str, Mapped]] = {"d": ("D", reflectance), "r": ("R", reflectance),
                                           "shading": ("S", light), "alpha": ("alpha (grey: 0)", signed)}
"""Parts of a prediction: their headings, and how they are shown."""


def given(batch: Batch) -> dict[str, np.ndarray]:
    """What the first example of a batch gives to a method, by heading."""
    return {"I_s": light(batch.inputs.i_s[0]), "S'": light(batch.inputs.s_prime[0])}


def found(batch: Batch, prediction: Prediction) -> dict[str, np.ndarray]:
    """What a method made of the first example, beside the truth, by heading; the parts that it has come last."""
    truth = inside_only(batch.truth.i_t[:1], batch.inputs.inside[:1])[0]
    shown = {"prediction": light(prediction.i_t[0]), "truth": light(truth),
             f"|difference| x {GAIN}": difference(prediction.i_t[0], truth)}
    for name, (heading, mapped) in PARTS.items():
        if (part := getattr(prediction, name)) is not None:
            shown[heading] = mapped(part[0])
    return shown


def cropped(shown: Mapping[str, np.ndarray], inside: torch.Tensor) -> dict[str, np.ndarray]:
    """The same pictures cut to the square about (1, H, W) `inside`, as far as the frame goes."""
    box = square(inside[0].cpu().numpy() > 0)
    return {heading: picture[box] for heading, picture in shown.items()}


def square(inside: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns of a square that holds all of (H, W) `inside` and a margin; smaller where the frame is."""
    height, width = inside.shape
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not rows.size:
        return slice(0, height), slice(0, width)
    side = max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1 + 2 * MARGIN
    return _span(int(rows[0] + rows[-1]), int(side), height), _span(int(columns[0] + columns[-1]), int(side), width)


def _span(ends: int, side: int, size: int) -> slice:
    """`side` pixels about the middle of the two ends whose sum is given, moved into the frame."""
    start = min(max((ends + 1 - side) // 2, 0), max(size - side, 0))
    return slice(start, start + min(side, size))


def _to_8bit(display: torch.Tensor) -> np.ndarray:
    """(H, W, 3) uint8 of (3, H, W) display values, clipped to [0, 1]."""
    rounded = (255 * display.detach().float().clamp(0, 1)).round().to(torch.uint8)
    return np.ascontiguousarray(rounded.permute(1, 2, 0).cpu().numpy())
