"""OpenEXR and Radiance files -> colours as they are stored, and what makes them linear Rec.709."""

import re
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from dataset_builder.assets.image_maps import MAX_PIXELS, MAX_SIDE
from dataset_builder.assets.primaries import REC709, rec709_from_rgb, xyz_from_rgb

COLOURS = (("R", "G", "B"), ("Y", "RY", "BY"), ("Y",))
"""Channels that are taken for colours, the first that are there."""
MAX_SAMPLES = 4 * MAX_PIXELS
"""Values of all channels of a file that is decoded."""
MAX_HEADER = 1 << 16
"""Bytes of a Radiance file that its header may take."""
DAMAGE = (RuntimeError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, MemoryError, OSError)
"""What readers raise for damaged files."""
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
    """The picture of an .exr or .hdr file. Raises ValueError that says what was found instead of one."""
    return {".exr": read_exr, ".hdr": _read_radiance}[path.suffix.lower()](path)


def mean_over_sphere(rows: np.ndarray) -> float:
    """Mean over the sphere of a latitude-longitude image, from the means (H,) of its rows.

    Its first and last rows are the poles, and between two rows it is linear in the polar angle t, as Mitsuba shows it:
    row i weighs the integral of its hat function times sin t.
    """
    step = np.pi / (len(rows) - 1)
    weights = 2 * np.sin(step * np.arange(len(rows))) * (1 - np.cos(step)) / step
    weights[[0, -1]] = 1 - np.sin(step) / step
    return float(np.average(rows, weights=weights))


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
        chromaticities = tuple(map(float, headers[0].get("chromaticities", REC709)))
    except _Unfit:
        raise
    except DAMAGE as error:
        raise ValueError(f"no OpenEXR picture that can be read ({error})") from error
    if wrong := [plane.dtype for plane in planes if plane.dtype.kind != "f"]:
        raise ValueError(f"channels of {wrong[0]}, where colours are float16 or float32")
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
        content = file.read()
    if not found or not lines or not lines[0].startswith("#?"):
        raise ValueError("no header of a Radiance picture")
    if size is None:
        raise ValueError("a resolution that is not of the form -Y height +X width, the only one that is read")
    height, width = map(int, size.groups())
    if max(width, height) > MAX_SIDE:
        raise ValueError(f"{width} x {height} pixels, more than {MAX_SIDE} a side")
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
    return LightPicture(pixels=rgbe_pixels(content, width, height) / correction, to_rec709=matrix)


def rgbe_pixels(content: bytes, width: int, height: int) -> np.ndarray:
    """(H, W, 3) float32 of what follows a Radiance header: mantissas with one exponent, flat or in runs.

    Raises ValueError where it is damaged; Mitsuba's reader may then write beyond its memory.
    """
    packed = 8 <= width < 1 << 15 and content[:2] == b"\2\2" and content[2:3] < b"\x80"
    flat = content[:4 * width * height] if not packed else _unpacked(content, width, height)
    if len(flat) != 4 * width * height:
        raise ValueError(f"{len(flat)} bytes of pixels, where {width} x {height} take {4 * width * height}")
    values = np.frombuffer(flat, dtype=np.uint8)
    values = values.reshape(height, 4, width).transpose(0, 2, 1) if packed else values.reshape(height, width, 4)
    if not packed and ((values[..., :3] == 1).all(axis=-1) & (values[..., 3] > 0)).any():
        raise ValueError("runs of the oldest kind, which are not read")
    scale = np.ldexp(np.float32(1), np.arange(256) - 136)
    scale[0] = 0
    return values[..., :3].astype(np.float32) * np.take(scale, values[..., 3:])


def _unpacked(content: bytes, width: int, height: int) -> bytearray:
    """Row by row the four channels one after the other."""
    values, at = bytearray(), 0
    start = bytes((2, 2, width >> 8, width & 255))
    for row in range(1, height + 1):
        if content[at:at + 4] != start:
            raise ValueError(f"no row {row} of {height} where it is to begin")
        at += 4
        while len(values) < 4 * width * row:
            count = content[at] if at < len(content) else 0
            if count == 0:
                raise ValueError(f"row {row} of {height} cut short")
            if count > 128:
                values += content[at + 1:at + 2] * (count - 128)
                at += 2
            else:
                values += content[at + 1:at + 1 + count]
                at += 1 + count
        if len(values) != 4 * width * row:
            raise ValueError(f"row {row} of {height} with more than {width} pixels")
    return values


def _numbers(line: str, value: str, count: int) -> tuple[float, ...]:
    """Those of a header's line."""
    numbers = tuple(float(word) for word in value.split())
    if len(numbers) != count or not all(map(isfinite, numbers)) or (count < 8 and min(numbers) <= 0):
        raise ValueError(f"{line}, where {count} numbers are to stand")
    return numbers

