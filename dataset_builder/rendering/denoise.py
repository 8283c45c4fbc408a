"""Which layers are denoised with which guides, on which pixels, and what is kept of the noisy layer: its mean.

Functions of arrays; `docs/denoising.md` says how every choice here was measured.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from dataset_builder.layers import LAYERS, Extent
from dataset_builder.planning.effects.pass_extents import ALBEDO, MASKS, NORMAL
from dataset_builder.rendering import oidn

MAX_MENDING = 1.1
"""Largest factor by which a mean is mended; where a few fireflies hold more of it, they are not spread over all."""


NEAR = 1.5
"""Pixels, one standard deviation: how far around a pixel the denoiser is judged there."""

Noisy = tuple[np.ndarray, np.ndarray]
"""(H, W, 3) estimate, and its standard error."""


def denoised(layers: Mapping[str, np.ndarray], guides: Mapping[str, np.ndarray], direct: Mapping[str, Noisy],
             names: Sequence[str], extents: Mapping[str, Extent]) -> dict[str, np.ndarray]:
    """All `layers` in their order, those in `names` denoised.

    Arrays are (H, W, C) float32; `guides` are the images that `decisions.guide_extents` asks for; `direct` has, for
    layers of the rough mesh, an estimate of what comes straight from lights. That shows every facet and has little
    noise, the rest is smooth and has nearly all the noise: each is denoised with guides that suit it. A layer of
    extent `object` is exactly 0 outside of the object, as before. A layer with values that are not finite stays as it
    is, for the gates to find. Raises UserError where the denoiser is missing.
    """
    return {name: _denoised(name, image, guides, direct.get(name), extents[name]) if name in names else image
            for name, image in layers.items()}


def _denoised(name: str, image: np.ndarray, guides: Mapping[str, np.ndarray], direct: Noisy | None,
              extent: Extent) -> np.ndarray:
    on_object = np.any([guides[mask][..., 0] > 0 for mask in MASKS[LAYERS[name].geometry]], axis=0)
    inside = on_object if extent == "object" else np.ones_like(on_object)
    if not inside.any() or not np.isfinite(image).all():
        return image
    albedo = guides[ALBEDO[name]] if name in ALBEDO else np.ones_like(image)
    normal = guides[NORMAL[LAYERS[name].geometry]]
    rectangle = _rectangle(inside)

    def filtered(noisy: np.ndarray, normal: np.ndarray) -> np.ndarray:
        found = np.zeros_like(image)
        cut = (each[rectangle] for each in (noisy, albedo, normal))
        found[rectangle] = oidn.denoise(*_continued(inside[rectangle], *cut))
        return found

    if direct is None:
        found = filtered(image, normal)
    else:
        # The clean mesh says where its surfaces bend; where only the rough one is, that has to do
        smooth = np.where(guides["mask"] > 0, guides[NORMAL["3dm"]], normal)
        found = _no_worse(*direct, filtered(direct[0], normal), inside) + filtered(image - direct[0], smooth)
    found[~inside] = 0
    for part in (on_object, inside & ~on_object):
        found[part] *= _mean_ratio(image[part], found[part])
    return found


def _rectangle(inside: np.ndarray) -> tuple[slice, slice]:
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def _continued(inside: np.ndarray, *images: np.ndarray) -> list[np.ndarray]:
    """The images with every pixel outside taken from the nearest one inside.

    A filter that sees an object on black blurs its outline into the black: worse there than no denoising at all.
    """
    if inside.all():
        return list(images)
    row, column = distance_transform_edt(~inside, return_distances=False, return_indices=True)
    return [image[row, column] for image in images]


def _no_worse(raw: np.ndarray, error: np.ndarray, found: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Between a noisy image and what a denoiser made of it, where the expected squared error is least.

    Where both differ by more than the noise explains, the rest is detail that the denoiser took away. With b^2 its mean
    square about a pixel and v the variance there, b^2 / (b^2 + v) of the difference is put back.
    """
    near = [gaussian_filter(np.where(inside[..., None], squared, 0), (NEAR, NEAR, 0))
            for squared in ((raw - found) ** 2, error**2)]
    lost = np.maximum(near[0] - near[1], 0)
    share = np.divide(lost, lost + near[1], out=np.zeros_like(lost), where=lost > 0)
    return found + share * (raw - found)


def _mean_ratio(raw: np.ndarray, found: np.ndarray) -> np.ndarray:
    """(3,) float32 factors that give (P, 3) denoised pixels the mean of the raw ones, per channel, within bounds.

    The raw mean has no bias, and its noise is small; the denoiser darkens, by half a percent and more at low spp.
    """
    wanted, there = raw.sum(axis=0, dtype=np.float64), found.sum(axis=0, dtype=np.float64)
    ratio = np.divide(wanted, there, out=np.ones_like(wanted), where=there > 0)
    return np.clip(ratio, 1 / MAX_MENDING, MAX_MENDING).astype(np.float32)
