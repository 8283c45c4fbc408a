"""Images of mesh files -> texels -> Texture: decoded, made linear, and brought to one size of bounded sides.

The decoder holds a whole image at 4 bytes a pixel, at most 1 GiB; everything after it goes in strips.
"""

import io
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.assets.asset import Texture, Wrap
from dataset_builder.assets.exr_picture import exr_size, is_exr, read_exr
from dataset_builder.assets.linear_texels import MAX_PIXELS, MAX_SIDE, reduced, reduced_floats
from dataset_builder.assets.texel_memory import shared_texels
from dataset_builder.digest import digest, sha256_bytes, sha256_file
from dataset_builder.errors import Problem, UserError

FORMATS = ("PNG", "JPEG", "WEBP", "TGA", "BMP", "TIFF", "GIF", "DDS", "AVIF")
"""What is read, as Pillow calls it, beside OpenEXR. Others of its decoders start programs, or are not for textures."""
LARGE = 1 << 22
"""Pixels from which the processes of a build share what one has read."""
MOST_PIXELS_PER_BYTE = 8 * 1032
"""Of a file that is as good as its header: deflate makes at most 1032 bytes of one (its author's technical page), of
8 pixels each; others stay below, but for those of `ENDLESS`, which have no limit."""
ENDLESS = ("WEBP", "AVIF", "TIFF")
BROKEN = (OSError, ValueError, SyntaxError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError,
          EOFError, MemoryError, AssertionError, struct.error, zlib.error)
"""What Pillow's decoders raise for damaged files."""
_OPENING = Lock()
_PRECISION: ContextVar[type[np.floating[Any]]] = ContextVar("precision", default=np.float32)


@dataclass(frozen=True, kw_only=True)
class ImageFile:
    """An encoded image, not yet read."""

    name: str
    """What messages call it: its path, or `images[3] of chair.glb`."""
    content: bytes | Path


@contextmanager
def half_texels() -> Iterator[None]:
    """Keep textures that are made meanwhile as float16, which the device holds them as, too: no step of 8 bits is
    lost."""
    token = _PRECISION.set(np.float16)
    try:
        yield
    finally:
        _PRECISION.reset(token)


def check_image(image: ImageFile) -> tuple[int, int]:
    """(width, height) from the image's header; nothing is decoded. Raises UserError for what is no image of `FORMATS`,
    or larger than `MAX_SIDE` and `MAX_PIXELS` allow."""
    with broken_named(image):
        if is_exr(image.content):
            return exr_size(image.content)
    with opened_image(image) as opened:
        return opened.size


def read_texels(image: ImageFile, *, srgb: bool, max_size: int, opaque: bool = False) -> np.ndarray:
    """(H, W, 4) float32 in [0, 1]: colour and coverage, which is 1 where the image has none.

    srgb: whether colours are encoded, and to be made linear; coverage never is, nor are floats. opaque: whether
    coverage is to be taken for 1. Sides longer than `max_size` texels are shrunk together by area means in linear
    light; those of sRGB colours are weighted by coverage, so that what is not there does not colour its neighbours. A
    single channel fills three. 16 bits of grey are kept, of 16 bits of a colour the upper 8 (Pillow has no more). The
    first frame is read; orientations, profiles and gammas beside the pixels are ignored, as glTF 2.0, section 3.8.2,
    asks. Raises UserError for what is no image, too large, or has floats that are not in [0, 1].
    """
    def read() -> np.ndarray:
        if holds_floats(image):
            return _exr_texels(image, max_size, opaque)
        with opened_image(image) as opened:
            opened.load()
            return reduced(opened, limited_size(opened.size, max_size), srgb=srgb, opaque=opaque)

    width, height = check_image(image)
    if width * height < LARGE:
        return read()
    how = {"srgb": srgb, "max_size": max_size, "opaque": opaque, "pillow": Image.__version__}
    return shared_texels(lambda made_by: digest({"texels": _sha256(image), "made_by": made_by, **how}), read)


def holds_floats(image: ImageFile) -> bool:
    """Whether an image is OpenEXR, of linear floats. Raises UserError where it cannot be read."""
    with broken_named(image):
        return is_exr(image.content)


def _exr_texels(image: ImageFile, max_size: int, opaque: bool) -> np.ndarray:
    """(H, W, 4) float32 of an OpenEXR file, in its own primaries."""
    with broken_named(image):
        picture = read_exr(image.content)
        covered = np.ones(picture.pixels.shape[:2], np.float32) if opaque or picture.alpha is None else picture.alpha
        size = limited_size((covered.shape[1], covered.shape[0]), max_size)
        return reduced_floats(np.dstack([picture.pixels, covered]), size)


def _sha256(image: ImageFile) -> str:
    try:
        return sha256_bytes(image.content) if isinstance(image.content, bytes) else sha256_file(image.content)
    except OSError as error:
        raise _refused(image, f"expected a readable image, got: {error}", "put it back") from error


@contextmanager
def opened_image(image: ImageFile) -> Iterator[Image.Image]:
    """The image with its header read; whatever goes wrong inside becomes a UserError that names it."""
    with broken_named(image), warnings.catch_warnings(action="ignore"), _unlimited(image) as opened:
        if max(opened.size) > MAX_SIDE or opened.width * opened.height > MAX_PIXELS:
            raise _refused(image, f"expected an image of at most {MAX_SIDE} pixels a side, got one of "
                           f"{opened.width} x {opened.height}", "save it smaller")
        size = len(image.content) if isinstance(image.content, bytes) else image.content.stat().st_size
        if opened.format not in ENDLESS and opened.width * opened.height > MOST_PIXELS_PER_BYTE * size:
            raise _refused(image, f"expected the pixels of an image of {opened.width} x {opened.height}, got "
                           f"{size} bytes, which cannot hold them", "the file was cut short; copy it again")
        yield opened


@contextmanager
def broken_named(image: ImageFile) -> Iterator[None]:
    """Turn what decoders raise for damaged files into a UserError that names the image."""
    try:
        yield
    except BROKEN as error:
        found = getattr(error, "strerror", None) or error or "damaged bytes"
        raise _refused(image, f"expected a readable image ({' '.join(FORMATS)} EXR), got: {found}",
                       "save it again as PNG or JPEG") from error


def _unlimited(image: ImageFile) -> Image.Image:
    """Opened without Pillow's own limit, which is below ours, and which it only has for the whole process."""
    content = io.BytesIO(image.content) if isinstance(image.content, bytes) else image.content
    with _OPENING:
        before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            return Image.open(content, formats=FORMATS)
        finally:
            Image.MAX_IMAGE_PIXELS = before


def _refused(image: ImageFile, rule: str, hint: str) -> UserError:
    return UserError([Problem(where=image.name, path="", rule=rule, hint=hint)])


def make_texture(maps: Mapping[str, np.ndarray], *, wrap: tuple[Wrap, Wrap] = ("repeat", "repeat"),
                 nearest: bool = False) -> Texture | None:
    """Texture of maps by their names there, (H, W) or (H, W, C); normals as they are encoded, in [0, 1]. None of none.
    Values are float32, or float16 within `half_texels`.

    All take the size of `base_color`, or of the first map that there is.
    """
    if not maps:
        return None
    first = maps.get("base_color", next(iter(maps.values())))
    size = first.shape[1], first.shape[0]
    made = {name: resized(np.atleast_3d(values), size) for name, values in maps.items()}
    if "normal" in made:
        made["normal"] = _unit_vectors(2 * made["normal"] - 1)
    shaped = {name: values if maps[name].ndim == 3 else values[..., 0] for name, values in made.items()}
    if "base_color" not in shaped:
        shaped["base_color"] = np.ones((size[1], size[0], 3))
    low = {"normal": -1.0}
    # In one piece of memory, which is clipped in a third of the time
    clipped: dict[str, Any] = {
        name: np.clip(np.ascontiguousarray(values), low.get(name, 0.0), 1).astype(_PRECISION.get())
        for name, values in shaped.items()}
    return Texture(wrap=wrap, nearest=nearest, **clipped)


def limited_size(size: tuple[int, int], max_size: int) -> tuple[int, int]:
    """(width, height) scaled down to sides of at most `max_size`, proportions kept, never below one texel."""
    factor = min(1.0, max_size / max(size))
    return max(1, round(size[0] * factor)), max(1, round(size[1] * factor))


def resized(texels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, C) texels at (width, height) `size`: area means where it shrinks, bilinear where it grows; in linear
    values."""
    if (texels.shape[1], texels.shape[0]) == size:
        return texels
    grows = size[0] > texels.shape[1] or size[1] > texels.shape[0]
    method = Image.Resampling.BILINEAR if grows else Image.Resampling.BOX
    channels = [np.asarray(Image.fromarray(channel.astype(np.float32)).resize(size, method))
                for channel in np.moveaxis(texels, 2, 0)]
    return np.stack(channels, axis=2)


def _unit_vectors(texels: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(texels, axis=2, keepdims=True)
    upright = np.broadcast_to((0.0, 0.0, 1.0), texels.shape)
    return np.where(length > 1e-6, texels / np.maximum(length, 1e-6), upright)
