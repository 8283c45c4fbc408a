"""Images that UsdLux lights show: which file, and how bright it is on the whole."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.image_maps import ImageFile, read_texels
from dataset_builder.assets.light_bounds import MOST_RADIANCE, bounded
from dataset_builder.assets.light_pictures import mean_over_sphere, read_picture
from dataset_builder.assets.primaries import REC709, xyz_from_rgb
from dataset_builder.digest import sha256_file
from dataset_builder.errors import UserError

if TYPE_CHECKING:
    from pxr import Sdf

    from dataset_builder.assets.scene_readers.usd_light_values import LightInputs

ImageFinder = Callable[["Sdf.AssetPath"], "ImageFound | str"]
"""Finds the file of a texture of a stage, or says in words why it is not to be read."""
LATLONG = ("automatic", "latlong")
"""Layouts of a dome's image that are read."""
LARGEST = 1024
"""Texels of a side that the mean of a lamp's image is taken from."""


@dataclass(frozen=True, kw_only=True)
class ImageFound:
    """A file of an image that a light may show."""

    path: Path
    root: Path
    """Folder that plans name images from."""


@dataclass(frozen=True, kw_only=True)
class ShownImage:
    """An image that a light shows."""

    fields: dict[str, str]
    """Of `LightPlan`."""
    mean: float
    """Its mean luminance: rendering brings images to mean 1."""
    plain: bool
    """Whether it has one colour, so that it does not matter how it is turned."""


def shown_image(inputs: "LightInputs", finder: ImageFinder | None, suffixes: tuple[str, ...], *,
                on_sphere: bool) -> ShownImage | None:
    """What `inputs:texture:file` names; None where it names nothing, or nothing that can be shown, which is said."""
    asset = inputs.value("texture:file")
    if asset is None or not getattr(asset, "path", ""):
        return None
    found = finder(asset) if finder else "no folder to find it in"
    layout = str(inputs.value("texture:format", "automatic"))
    if isinstance(found, str):
        return _without(inputs, asset, found)
    if layout not in LATLONG:
        return _without(inputs, asset, f"layout {layout}, where latlong is read")
    suffix = found.path.suffix.lower()
    if suffix not in suffixes:
        return _without(inputs, asset, f"{suffix or 'no suffix'}, where {' and '.join(suffixes)} are read")
    try:
        mean, plain = _mean(found.path, on_sphere=on_sphere)
        digest = sha256_file(found.path)
    except (OSError, ValueError, UserError) as error:
        return _without(inputs, asset, str(error))
    if mean == 0:
        return _without(inputs, asset, "it is black")
    bounded(inputs.path, inputs.name, "mean of the image", mean, high=MOST_RADIANCE)
    name = Path(os.path.relpath(found.path, found.root)).as_posix()
    return ShownImage(fields={"image": name, "image_sha256": digest}, mean=mean, plain=plain)


def _without(inputs: "LightInputs", asset: "Sdf.AssetPath", why: str) -> ShownImage | None:
    """None, and the reason said."""
    inputs.say(f"image {asset.path} ({why}); the light's colour alone is taken")
    return None


def _mean(path: Path, *, on_sphere: bool) -> tuple[float, bool]:
    """Mean luminance of an image, over the sphere or its area, and whether it has one colour. Raises UserError or
    ValueError for what is none."""
    if path.suffix.lower() == ".png":
        pixels = read_texels(ImageFile(name=path.name, content=path), srgb=True, max_size=LARGEST)[..., :3]
    else:
        picture = read_picture(path)
        pixels = picture.pixels
        if not (np.isfinite(pixels).all() and (pixels >= 0).all()):
            raise ValueError("values that are not finite, or below 0")
        pixels = pixels if picture.to_rec709 is None else np.maximum(pixels @ picture.to_rec709.T, 0)
    rows = (pixels @ xyz_from_rgb(REC709)[1]).mean(axis=1, dtype=np.float64)
    mean = mean_over_sphere(rows) if on_sphere and len(rows) > 1 else float(rows.mean())
    return mean, bool((pixels == pixels[0, 0]).all())
