"""OpenEXR, Radiance and PNG files -> colours as they are stored, and what makes them linear Rec.709."""

import re
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from mitsuba import mitsuba_ext

from dataset_builder.assets.image_maps import MAX_PIXELS, MAX_SIDE, ImageFile, check_image
from dataset_builder.errors import UserError
from dataset_builder.rendering.scene.primaries import REC709, rec709_from_rgb, xyz_from_rgb

COLOURS = (("R", "G", "B"), ("Y", "RY", "BY"), ("Y",))
"""Channels that are taken for colours, the first that are there."""
MAX_SAMPLES = 4 * MAX_PIXELS
"""Values of all channels of a file that is decoded."""
MAX_HEADER = 1 << 16
"""Bytes of a Radiance file that its header may take."""
DAMAGE = (RuntimeError, ValueError, TypeError, IndexError, KeyError, MemoryError, OSError)
NUMBERS = {"COLORCORR": 3, "PRIMARIES": 8, "GAMMA": 1}
"""Lines of a Radiance header that change colours, and how many numbers they have. What changes brightness alone
changes no picture that is brought to mean 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LightPicture:
    """A decoded file."""

    pixels: np.ndarray
    """(H, W, 3) float32, linear, in the file's own primaries."""
    to_rec709: np.ndarray | None = None
    """(3, 3) matrix from those primaries; None where they are Rec.709's."""


def read_picture(path: Path) -> LightPicture:
    """The picture of an .exr, .hdr or .png file (sRGB). Raises ValueError that says what was found instead of one."""
    kinds = {".exr": read_exr, ".hdr": _read_radiance, ".png": _read_png}
    return kinds[path.suffix.lower()](path)


def read_exr(path: Path) -> LightPicture:
    """Colours of the first part: R, G, B, or luminance with or without chroma; at the root, or in the only layer that
    has them. Alpha is passed over: colours are those in front of black. Raises ValueError for anything else.

    Mitsuba's own reader and writer hand rows to a pool of threads that, in a process which has other libraries' pools
    too, may never answer.
    """
    try:
        headers = [part.header for part in OpenEXR.File(str(path), separate_channels=True, header_only=True).parts]
        names = _colours(headers)
        _check_headers(headers)
        channels = OpenEXR.File(str(path), separate_channels=True).channels(0)
        planes = [np.asarray(channels[name].pixels) for name in names]
    except _Unfit:
        raise
    except DAMAGE as error:
        raise ValueError(f"no OpenEXR picture that can be read ({error})") from error
    if wrong := [plane.dtype for plane in planes if plane.dtype.kind != "f"]:
        raise ValueError(f"channels of {wrong[0]}, where colours are float16 or float32")
    chromaticities = tuple(map(float, headers[0].get("chromaticities", REC709)))
    matrix = rec709_from_rgb(chromaticities)
    planes = [plane.astype(np.float32) for plane in planes]
    if len(planes) == 1:
        return LightPicture(pixels=np.stack(planes * 3, axis=-1))
    if names[0].rpartition(".")[2] == "Y":
        planes = _from_chroma(planes[0], planes[1], planes[2], xyz_from_rgb(chromaticities)[1])
    return LightPicture(pixels=np.stack(planes, axis=-1), to_rec709=matrix)


class _Unfit(ValueError):
    """A picture that can be read and is not of the kind that is wanted."""


def _colours(headers: list[dict[str, Any]]) -> tuple[str, ...]:
    """Names of the channels of colours in the first part."""
    parts = [[channel.name for channel in header["channels"]] for header in headers]
    layers: dict[str, set[str]] = {}
    for name in parts[0]:
        layer, _, channel = name.rpartition(".")
        layers.setdefault(layer, set()).add(channel)
    # Y beside X is no luminance of a picture but one of three coordinates
    found = {layer: next((names for names in COLOURS if set(names) <= there and not (names[0] == "Y" and "X" in there)),
                         ()) for layer, there in layers.items()}
    named = [layer for layer, names in found.items() if names]
    if "" in named or len(named) == 1:
        layer = "" if "" in named else named[0]
        return tuple(f"{layer}.{name}" if layer else name for name in found[layer])
    rule = f"layers {', '.join(sorted(named))}, where one is to have colours" if named else \
        f"channels {', '.join(sorted(parts[0]))}, none of them R, G, B or Y"
    raise _Unfit(rule if len(parts) == 1 else f"{len(parts)} parts, the first with {rule}")


def _check_headers(headers: list[dict[str, Any]]) -> None:
    """Raise ValueError for what is too large to decode, no flat picture, not the whole one, or six faces of a cube."""
    samples = 0
    for header in headers:
        (left, top), (right, bottom) = ((int(x), int(y)) for x, y in header["dataWindow"])
        width, height = right - left + 1, bottom - top + 1
        if max(width, height) > MAX_SIDE:
            raise _Unfit(f"{width} x {height} pixels, more than {MAX_SIDE} a side")
        samples += width * height * len(header["channels"])
    if samples > MAX_SAMPLES:
        raise _Unfit(f"{samples} values in all channels, more than {MAX_SAMPLES}")
    first = headers[0]
    if first.get("type") not in (None, OpenEXR.scanlineimage, OpenEXR.tiledimage):
        raise _Unfit("samples in depth, not one picture")
    if first.get("envmap") == OpenEXR.ENVMAP_CUBE:
        raise _Unfit("the six faces of a cube, not latitude and longitude")
    windows = [tuple(tuple(map(int, corner)) for corner in first[name]) for name in ("dataWindow", "displayWindow")]
    if windows[0] != windows[1]:
        raise _Unfit(f"pixels of the window {windows[0]}, not of the whole picture {windows[1]}")


def _from_chroma(luminance: np.ndarray, red: np.ndarray, blue: np.ndarray, weights: np.ndarray) -> list[np.ndarray]:
    """R, G, B of Y, RY = (R - Y) / Y and BY = (B - Y) / Y (OpenEXR's technical introduction), chroma interpolated
    between the pixels that have it; where Y is no luminance, neither are they colours."""
    red, blue = (_enlarged(chroma, luminance.shape).astype(np.float64) for chroma in (red, blue))
    planes = [(red + 1) * luminance, luminance, (blue + 1) * luminance]
    planes[1] = (luminance - weights[0] * planes[0] - weights[2] * planes[2]) / weights[1]
    return [np.where(luminance >= 0, np.maximum(plane, 0), luminance).astype(np.float32) for plane in planes]


def _enlarged(chroma: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Chroma of every second row and column, say, at all of them."""
    for axis, (size, wanted) in enumerate(zip(chroma.shape, shape, strict=True)):
        step = -(-wanted // size)
        if step > 1:
            at = np.minimum(np.arange(wanted) / step, size - 1)
            low = np.floor(at).astype(np.intp)
            share = (at - low).reshape([-1 if each == axis else 1 for each in range(2)])
            high = np.minimum(low + 1, size - 1)
            chroma = chroma.take(low, axis) * (1 - share) + chroma.take(high, axis) * share
    return chroma


def _read_radiance(path: Path) -> LightPicture:
    """Radiance's .hdr (Ward, "Real Pixels", Graphics Gems II, 1991), with the corrections of its header undone."""
    with path.open("rb") as file:
        header, found, _ = file.read(MAX_HEADER).partition(b"\n\n")
        lines = header.decode("latin-1").splitlines()
        file.seek(len(header) + 2)
        size = re.fullmatch(rb"-Y (\d+) \+X (\d+)\s*", file.readline(100))
    if not found or not lines or not lines[0].startswith("#?"):
        raise ValueError("no header of a Radiance picture")
    if size is None:
        raise ValueError("a resolution that is not of the form -Y height +X width, the only one that is read")
    if max(int(side) for side in size.groups()) > MAX_SIDE:
        raise ValueError(f"{int(size[2])} x {int(size[1])} pixels, more than {MAX_SIDE} a side")
    matrix, correction = None, np.ones(3, dtype=np.float32)
    for line in lines[1:]:
        key, _, value = line.partition("=")
        if key == "FORMAT" and value.strip() != "32-bit_rle_rgbe":
            raise ValueError(f"FORMAT={value.strip()}, where 32-bit_rle_rgbe is read")
        if key in NUMBERS:
            numbers = _numbers(line, value, NUMBERS[key])
            if key == "GAMMA" and numbers != (1.0,):
                raise ValueError(f"{line}, where values are to be linear")
            if key == "COLORCORR":
                correction *= np.array(numbers, dtype=np.float32)
            matrix = rec709_from_rgb(numbers) if key == "PRIMARIES" else matrix
    return LightPicture(pixels=_by_mitsuba(path) / correction, to_rec709=matrix)


def _numbers(line: str, value: str, count: int) -> tuple[float, ...]:
    """Those of a header's line."""
    numbers = tuple(float(word) for word in value.split())
    if len(numbers) != count or not all(map(isfinite, numbers)) or (count < 8 and min(numbers) <= 0):
        raise ValueError(f"{line}, where {count} numbers are to stand")
    return numbers


def _read_png(path: Path) -> LightPicture:
    try:
        check_image(ImageFile(name=path.name, content=path))
    except UserError as error:
        raise ValueError(error.problems[0].rule) from error
    return LightPicture(pixels=_by_mitsuba(path))


def _by_mitsuba(path: Path) -> np.ndarray:
    """(H, W, 3) float32 linear; Mitsuba's class of bitmaps is the same in every variant, and needs none here."""
    bitmap = mitsuba_ext.Bitmap
    try:
        made = bitmap(str(path)).convert(bitmap.PixelFormat.RGB, mitsuba_ext.Struct.Type.Float32, srgb_gamma=False)
    except RuntimeError as error:
        raise ValueError(str(error).strip().splitlines()[-1]) from error
    return np.array(made, dtype=np.float32)
