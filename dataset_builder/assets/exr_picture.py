"""OpenEXR files -> values as they are stored."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from dataset_builder.assets.linear_texels import MAX_PIXELS, MAX_SIDE
from dataset_builder.assets.primaries import REC709, rec709_from_rgb, xyz_from_rgb

COLOURS = (("R", "G", "B"), ("Y", "RY", "BY"), ("Y",))
"""Channels that are taken for colours, the first that are there."""
MAGIC = b"\x76\x2f\x31\x01"
"""First bytes of every file."""
MAX_SAMPLES = 4 * MAX_PIXELS
"""Values of all channels of a file that is decoded."""
DAMAGE = (RuntimeError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, MemoryError, OSError)
"""What readers raise for damaged files."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FloatPicture:
    """A decoded file."""

    pixels: np.ndarray
    """(H, W, 3) float32, linear, in the file's own primaries."""
    to_rec709: np.ndarray | None = None
    """(3, 3) matrix from those primaries; None where they are Rec.709's."""
    alpha: np.ndarray | None = None
    """(H, W) float32, where the file has it."""


def read_exr(content: bytes | Path) -> FloatPicture:
    """Colours of the first part: R, G, B, or luminance with or without chroma; at the root, or in the only layer that
    has them; with the alpha beside them. Raises ValueError for anything else.

    Mitsuba's own reader and writer hand rows to a pool of threads that, in a process which has other libraries' pools
    too, may never answer.
    """
    with _damage_named():
        headers, names = _opened(content)
        channels = OpenEXR.File(_source(content), separate_channels=True).channels(0)
        planes = {name: np.asarray(channels[name].pixels) for name in (*names, _alpha(names)) if name in channels}
        chromaticities = tuple(map(float, headers[0].get("chromaticities", REC709)))
    if wrong := [plane.dtype for plane in planes.values() if plane.dtype.kind != "f"]:
        raise ValueError(f"channels of {wrong[0]}, where colours are float16 or float32")
    matrix, floats = rec709_from_rgb(chromaticities), {name: plane.astype(np.float32) for name, plane in planes.items()}
    colours, alpha = [floats[name] for name in names], floats.get(_alpha(names))
    if len(colours) == 1:
        return FloatPicture(pixels=np.stack(colours * 3, axis=-1), alpha=alpha)
    if names[0].rpartition(".")[2] == "Y":
        colours = _from_chroma(colours[0], colours[1], colours[2], xyz_from_rgb(chromaticities)[1])
    return FloatPicture(pixels=np.stack(colours, axis=-1), to_rec709=matrix, alpha=alpha)


def exr_size(content: bytes | Path) -> tuple[int, int]:
    """(width, height) from the header of what `read_exr` reads; nothing is decoded. Raises ValueError as it does."""
    with _damage_named():
        headers, _ = _opened(content)
        (left, top), (right, bottom) = headers[0]["dataWindow"]
    return int(right) - int(left) + 1, int(bottom) - int(top) + 1


def is_exr(content: bytes | Path) -> bool:
    """Whether something begins as an OpenEXR file does. Raises OSError where it cannot be read."""
    if isinstance(content, bytes):
        return content.startswith(MAGIC)
    with content.open("rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC


def _source(content: bytes | Path) -> Any:
    return io.BytesIO(content) if isinstance(content, bytes) else str(content)


def _alpha(names: tuple[str, ...]) -> str:
    """Name of the alpha beside channels of colours."""
    layer = names[0].rpartition(".")[0]
    return f"{layer}.A" if layer else "A"


def _opened(content: bytes | Path) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Headers of all parts, found to be fit, and names of the channels of colours."""
    headers = [part.header for part in OpenEXR.File(_source(content), separate_channels=True, header_only=True).parts]
    names = _colours(headers)
    _check_headers(headers)
    return headers, names


@contextmanager
def _damage_named() -> Iterator[None]:
    """Turn what OpenEXR raises into a ValueError."""
    try:
        yield
    except _Unfit:
        raise
    except DAMAGE as error:
        raise ValueError(f"no OpenEXR picture that can be read ({error})") from error


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
