"""OpenEXR and Radiance files -> colours as they are stored, and what makes them linear Rec.709."""

import re
from math import isfinite
from pathlib import Path

import numpy as np

from dataset_builder.assets.exr_picture import FloatPicture, read_exr
from dataset_builder.assets.linear_texels import MAX_SIDE
from dataset_builder.assets.primaries import rec709_from_rgb

MAX_HEADER = 1 << 16
"""Bytes of a Radiance file that its header may take."""
NUMBERS = {"COLORCORR": 3, "PRIMARIES": 8, "GAMMA": 1}
"""Lines of a Radiance header that change colours, and how many numbers they have. What changes brightness alone
changes no picture that is brought to mean 1."""


def read_picture(path: Path) -> FloatPicture:
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


def _read_radiance(path: Path) -> FloatPicture:
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
    return FloatPicture(pixels=rgbe_pixels(content, width, height) / correction, to_rec709=matrix)


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

