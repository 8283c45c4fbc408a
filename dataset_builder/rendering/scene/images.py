"""Images that lights show: read, checked, and brought to the few sizes that kernels are compiled for."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from mitsuba import mitsuba_ext

from dataset_builder.assets.exr_picture import FloatPicture
from dataset_builder.assets.image_maps import ImageFile, check_image, resized
from dataset_builder.assets.light_pictures import mean_over_sphere, read_picture
from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.planning.view.emission import LUMINANCE

KEPT = 4
"""Images kept in memory: those of the lights of one view."""
LAMP_SIDE = 256
"""Texels along a side of what a lamp shows: one size, one kernel."""
MIN_WIDTH, MAX_WIDTH = 64, 4096
"""Texels around the horizon of an environment."""


@lru_cache(maxsize=KEPT)
def read_image(path: Path, sha256: str, suffixes: tuple[str, ...]) -> np.ndarray:
    """(H, W, 3) float32 linear Rec.709 of an OpenEXR, Radiance or PNG file (sRGB), not to be written to.

    Colours that Rec.709 does not have lose what is below 0. suffixes: those that its use allows. Raises PlanError where
    the file has another one, is missing, is not the one that was planned, cannot be read, is black, or holds values
    that are not finite or below 0.
    """
    if path.suffix.lower() not in suffixes:
        raise _refused(path, f"expected a file of kind {' '.join(suffixes)}, got {path.suffix or 'none'}", "convert it")
    try:
        found = sha256_file(path)
    except OSError as error:
        raise _refused(path, f"expected a readable file, got: {error.strerror}", "put it back") from error
    if found != sha256:
        raise _refused(path, f"expected content of SHA-256 {sha256}, got {found}",
                       "the file changed after planning; plan again")
    try:
        picture = _read_png(path) if path.suffix.lower() == ".png" else read_picture(path)
    except ValueError as error:
        raise _refused(path, f"expected an image of colours, got: {error}", "save it again as one") from error
    image = picture.pixels
    bad = image[~(np.isfinite(image) & (image >= 0))]
    if len(bad):
        raise _refused(path, f"expected finite values of at least 0, got {bad[0]:g} in {len(bad)} places", "mend it")
    if picture.to_rec709 is not None:
        image = np.maximum(image @ picture.to_rec709.T, 0).astype(np.float32)
    # What underflows when it is brought to mean 1 is as good as black
    if image.mean(dtype=np.float64) < np.finfo(np.float32).tiny:
        raise _refused(path, "expected an image with a value above 0, got a black one", "leave it out, or correct it")
    image.flags.writeable = False
    return image


def lamp_texture(image: np.ndarray) -> np.ndarray:
    """(LAMP_SIDE, LAMP_SIDE, 3) float32 of mean luminance 1, of an image that is not black."""
    texels = resized(image, (LAMP_SIDE, LAMP_SIDE))
    return (texels / float(texels.mean(axis=(0, 1), dtype=np.float64) @ LUMINANCE)).astype(np.float32)


def environment(image: np.ndarray) -> np.ndarray:
    """(W/2, W, 3) float32 of mean luminance 1 over the sphere, of an image that is not black; the width is a power of
    two, the next one to the image's."""
    width = int(np.clip(1 << (image.shape[1] - 1).bit_length(), MIN_WIDTH, MAX_WIDTH))
    texels = resized(image, (width, width // 2))
    return (texels / mean_luminance(texels)).astype(np.float32)


def mean_luminance(image: np.ndarray) -> float:
    """Mean luminance over the sphere of a latitude-longitude image."""
    return mean_over_sphere((image @ LUMINANCE).mean(axis=1, dtype=np.float64))


def _read_png(path: Path) -> FloatPicture:
    """Of sRGB. Raises ValueError as `read_picture` does."""
    try:
        check_image(ImageFile(name=path.name, content=path))
    except UserError as error:
        raise ValueError(error.problems[0].rule) from error
    return FloatPicture(pixels=_by_mitsuba(path))


def _by_mitsuba(path: Path) -> np.ndarray:
    """(H, W, 3) float32 linear; Mitsuba's class of bitmaps is the same in every variant, and needs none here."""
    bitmap = mitsuba_ext.Bitmap
    try:
        made = bitmap(str(path)).convert(bitmap.PixelFormat.RGB, mitsuba_ext.Struct.Type.Float32, srgb_gamma=False)
    except RuntimeError as error:
        raise ValueError(str(error).strip().splitlines()[-1]) from error
    return np.array(made, dtype=np.float32)


def _refused(path: Path, rule: str, hint: str) -> PlanError:
    return PlanError([Problem(where=str(path), path="", rule=rule, hint=hint)])
