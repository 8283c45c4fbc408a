"""Texels of materials and lights -> image files in which every value survives."""

import io
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

from dataset_builder.assets.linear_texels import linear_from_srgb
from dataset_builder.digest import sha256_bytes
from dataset_builder.shards.exr import encode_picture

LEVELS = np.arange(256) / 255
DECODED = {"sRGB": linear_from_srgb(LEVELS).astype(np.float32), "raw": LEVELS.astype(np.float32)}
"""Linear values of the 256 levels of an 8-bit image, by how USD calls its colour space."""


@dataclass(frozen=True, kw_only=True)
class TexelFile:
    """A file that was written."""

    path: str
    """Relative to the folder of the stage, with `/`."""
    space: str
    """`raw` or `sRGB`, as `inputs:sourceColorSpace` has it."""


@dataclass(frozen=True, kw_only=True)
class TexelFiles:
    """The images beside a stage; those of equal content are one file."""

    folder: Path
    """Of the stage; images go into `textures` in it."""
    _known: dict[str, TexelFile] = field(default_factory=dict)

    def write(self, texels: np.ndarray, name: str, *, color: bool) -> TexelFile:
        """Write (H, W) or (H, W, 3) linear float16 or float32 texels as a PNG of 8 bits where that decodes to the same
        floats, else as OpenEXR. color: whether 8 bits are sRGB, as viewers expect of colours; data never are."""
        space = "sRGB" if color else "raw"
        decoded = DECODED[space].astype(texels.dtype).astype(np.float32)
        texels = np.ascontiguousarray(texels, dtype=np.float32)
        if (levels := _levels(texels, decoded)) is not None:
            stream = io.BytesIO()
            Image.fromarray(levels).save(stream, "PNG")
            return self._kept(stream.getvalue(), name, "png", space)
        whole = np.repeat(texels[..., None], 3, axis=2) if texels.ndim == 2 else texels
        return self._kept(encode_picture(whole, name="texels"), name, "exr", "raw")

    def _kept(self, data: bytes, name: str, suffix: str, space: str) -> TexelFile:
        digest = sha256_bytes(data)
        if digest not in self._known:
            stem = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-") or "texels"
            path = f"textures/{stem}-{digest[:8]}.{suffix}"
            (self.folder / "textures").mkdir(exist_ok=True)
            (self.folder / path).write_bytes(data)
            self._known[digest] = TexelFile(path=path, space=space)
        return self._known[digest]


def _levels(texels: np.ndarray, decoded: np.ndarray) -> np.ndarray | None:
    """The 8-bit levels that decode to exactly these values, or None."""
    nearest = np.searchsorted(decoded, texels).clip(0, 255)
    return nearest.astype(np.uint8) if np.array_equal(decoded[nearest], texels) else None
