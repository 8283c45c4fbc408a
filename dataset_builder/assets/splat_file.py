"""Files of Gaussian splats: whichever format, one cloud."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers import splat_gltf, splat_ply, splat_spz, splat_usd
from dataset_builder.assets.readers.splat_columns import SplatFile
from dataset_builder.spec.usd_references import USD_SUFFIXES

READERS: dict[str, Callable[[Path], SplatFile]] = {
    ".glb": splat_gltf.read, ".gltf": splat_gltf.read, ".ply": splat_ply.read, ".spz": splat_spz.read,
    **dict.fromkeys(USD_SUFFIXES, splat_usd.read)}
"""What reads the splats of a file, by its suffix."""
UPWARD = {".ply": (0.0, -1.0, 0.0)}
"""Where up is in files of a format, unless their owner says otherwise: COLMAP's y points down; all others have y up."""


def read_splats(path: Path, *, srgb: bool | None = None) -> SplatFile:
    """All splats of a file, in its own units and axes. srgb: whether colours are sRGB-encoded, if that is known better
    than the file says. Raises UserError where it cannot be read."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        refuse(path, f"expected splats in a file that ends in one of {' '.join(sorted(READERS))}",
               "write the splats as .ply, with SuperSplat or splat-transform")
    found = reader(path)
    return found if srgb is None else replace(found, cloud=replace(found.cloud, srgb=srgb))


def upward(path: Path) -> np.ndarray:
    """(3,) unit vector that usually points up in a file of this format."""
    return np.array(UPWARD.get(path.suffix.lower(), (0.0, 1.0, 0.0)))
