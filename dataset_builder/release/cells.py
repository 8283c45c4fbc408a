"""An example as a few hundred cells: means over small squares of the object, in which noise and roughness average out.

A pixel of S' has the noise of its paths and the slope of its own little facet; a pixel on an outline mixes object and
background. So layers are compared over squares, and only over pixels that both meshes cover wholly.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

WHOLE = 0.999
"""Least mask of a pixel that is covered wholly."""
MIN_SIDE, MAX_SIDE = 4, 16
PER_SIDE = 16
"""Cells along the shorter side of the frame, within the bounds of pixels above."""
FILLED = 0.5
"""Least share of a cell's pixels that must be covered wholly."""
DIFFUSE = 0.7
"""Least D / (D + R) of a cell whose light is expected to follow D S'."""
MIN_LIGHT = 1e-2
"""Of the example's mean S': darker cells are noise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cells:
    """Means over cells of one example, (C, 3) each."""

    key: str
    clear: bool
    """False in fog, where no layer tells what it did to i_s, and where i_s is the image of a field."""
    i_s: np.ndarray
    d: np.ndarray
    r: np.ndarray
    s_prime: np.ndarray
    i_t: np.ndarray
    """Less the fog before it."""
    d_s: np.ndarray
    """Of the product d s_prime."""

    def __len__(self) -> int:
        return len(self.d)

    def keep(self, where: np.ndarray) -> "Cells":
        """The cells where a (C,) truth holds."""
        return Cells(key=self.key, clear=self.clear, i_s=self.i_s[where], d=self.d[where], r=self.r[where],
                     s_prime=self.s_prime[where], i_t=self.i_t[where], d_s=self.d_s[where])

    @property
    def diffuseness(self) -> np.ndarray:
        """(C,) D / (D + R), channels together; 0 where nothing is reflected."""
        d, total = self.d.sum(axis=1), (self.d + self.r).sum(axis=1)
        return np.divide(d, total, out=np.zeros_like(total), where=total > 0)

    @property
    def is_diffuse(self) -> np.ndarray:
        """(C,) truth: cells that reflect diffusely for the most part, and have light."""
        light = self.s_prime.sum(axis=1)
        lit = light > MIN_LIGHT * (light.mean() if len(light) else 0.0)
        return (self.diffuseness >= DIFFUSE) & lit & (self.i_t.sum(axis=1) > 0)

    @property
    def diffuse(self) -> "Cells":
        """Those cells alone."""
        return self.keep(self.is_diffuse)


def cells_of(key: str, layers: Mapping[str, np.ndarray], *, fog: bool, rendered: bool = True) -> Cells:
    """Cells of an example's (H, W, C) layers: the paper's six, and `mask_rough` and `air` where there are such.
    rendered: whether its i_s is.

    None in fog without `air`: what the fog did to i_t cannot be told.
    """
    core = covered(layers).astype(np.float64)[..., None]
    side = cell_side(core.shape[0], core.shape[1])
    count = _sums(core, side)[..., 0]
    wanted = (count >= FILLED * side**2) & (not fog or "air" in layers)
    i_t = layers["i_t"] - layers["air"] if "air" in layers else layers["i_t"]
    arrays = {"i_s": layers["i_s"], "d": layers["d"], "r": layers["r"], "s_prime": layers["s_prime"], "i_t": i_t,
              "d_s": layers["d"].astype(np.float64) * layers["s_prime"]}
    means = {name: _sums(array * core, side)[wanted] / count[wanted][:, None] for name, array in arrays.items()}
    return Cells(key=key, clear=rendered and not fog, **means)


def cell_side(height: int, width: int) -> int:
    """Pixels along a side of a cell."""
    return int(np.clip(round(min(height, width) / PER_SIDE), MIN_SIDE, MAX_SIDE))


def covered(layers: Mapping[str, np.ndarray]) -> np.ndarray:
    """(H, W) truth: pixels that the object covers wholly in both meshes.

    Without `mask_rough` nothing says where the R3DM ends, so that pixels next to an outline of the 3DM are left out.
    """
    whole = layers["mask"][..., 0] >= WHOLE
    if "mask_rough" in layers:
        return whole & (layers["mask_rough"][..., 0] >= WHOLE)
    return eroded(whole, 2)


def eroded(where: np.ndarray, steps: int) -> np.ndarray:
    """(H, W) truth less the pixels within `steps` rows or columns of one that is false or outside of the frame."""
    padded = np.pad(where, steps)
    shifts = range(2 * steps + 1)
    rows = np.logical_and.reduce([padded[i:i + where.shape[0]] for i in shifts])
    return np.logical_and.reduce([rows[:, i:i + where.shape[1]] for i in shifts])


def _sums(image: np.ndarray, side: int) -> np.ndarray:
    """(rows, columns, C) sums over squares of an (H, W, C) image; what is left over at the lower right is left out."""
    rows, columns = image.shape[0] // side, image.shape[1] // side
    cut = image[:rows * side, :columns * side]
    return cut.reshape(rows, side, columns, side, -1).sum(axis=(1, 3), dtype=np.float64)
