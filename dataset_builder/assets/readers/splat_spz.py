"""Splats of an .spz file, versions 2 and 3: https://github.com/nianticlabs/spz

A gzip stream of a header and six arrays in fixed point. Its axes are right, up and back: y is up.
"""

import struct
import zlib
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers.polygon_checks import content_of
from dataset_builder.assets.readers.splat_columns import SplatFile, check_count, checked_cloud
from dataset_builder.geometry.splat_harmonics import COUNTS

MAGIC = 0x5053474E
HEADER = struct.Struct("<IIIBBBB")
HIGHEST = 4
"""Degree of harmonics that a file may have; those above 3 are not taken."""
FEATURES = {0: 0, 1: 3, 2: 8, 3: 15, 4: 24}
"""Coefficients above degree 0 of a channel, by degree."""
COLOUR = 0.15
"""Of the coefficient of degree 0, what a step of all 255 stands for."""
MORE = 2
"""Flag: something follows the arrays."""


def read(path: Path) -> SplatFile:
    """All splats, colours taken as sRGB. Raises UserError where the file breaks the format, is cut short, is of another
    version, or has too many."""
    data = content_of(path)
    if data[:4] == MAGIC.to_bytes(4, "little"):
        refuse(path, "expected an .spz file of version 2 or 3, got a later one", "write it as version 3, or as .ply")
    stream = zlib.decompressobj(16 + zlib.MAX_WBITS)
    try:
        head = stream.decompress(data, HEADER.size)
    except zlib.error as error:
        refuse(path, f"expected a gzip stream, got: {error}")
    if len(head) < HEADER.size:
        refuse(path, f"expected a header of {HEADER.size} bytes, got {len(head)}")
    magic, version, count, degree, fraction, flags, _ = HEADER.unpack(head)
    if magic != MAGIC or version not in (2, 3):
        refuse(path, f"expected an .spz file of version 2 or 3, got magic {magic:#x} and version {version}")
    if degree > HIGHEST or fraction > 24:
        refuse(path, f"expected harmonics of degree 0 to {HIGHEST} and at most 24 fractional bits, got {degree} and "
                     f"{fraction}")
    check_count(path, count)
    widths = {"centres": 9, "opacities": 1, "colours": 3, "scales": 3, "turns": 3 if version == 2 else 4,
              "harmonics": 3 * FEATURES[degree]}
    needed = count * sum(widths.values())
    body = _body(path, stream, needed, count)
    if (stream.decompress(stream.unconsumed_tail, 1) if stream.unconsumed_tail else b"") and not flags & MORE:
        refuse(path, f"expected {needed:,} bytes of {count:,} splats, as the header says, got more")
    columns, start = {}, 0
    for name, width in widths.items():
        columns[name] = body[start:start + count * width].reshape(count, width)
        start += count * width
    notes = [*(["extensions, not taken"] if flags & MORE else []),
             *(["trained with anti-aliasing, drawn without"] if flags & 1 else []),
             *([f"harmonics of degree {degree}, taken to degree 3"] if degree > 3 else [])]
    harmonics = np.concatenate([(columns["colours"] / np.float32(255) - np.float32(0.5))[:, None] / np.float32(COLOUR),
                                columns["harmonics"].reshape(count, -1, 3) / np.float32(128) - 1], axis=1)
    return checked_cloud(
        path, centres=_fixed(columns["centres"]) / np.float32(1 << fraction),
        scales=np.exp(columns["scales"] / np.float32(16) - 10),
        turns=_three(columns["turns"]) if version == 2 else _smallest_three(columns["turns"]),
        opacities=columns["opacities"][:, 0] / np.float32(255), harmonics=harmonics[:, :COUNTS[-1]], srgb=True,
        notes=tuple(notes))


def _body(path: Path, stream: "zlib._Decompress", needed: int, count: int) -> np.ndarray:
    """(needed,) bytes that follow the header, and never more: a small file may unpack to any size."""
    try:
        found = stream.decompress(stream.unconsumed_tail, needed)
    except zlib.error as error:
        refuse(path, f"expected a gzip stream, got: {error}", "the file is damaged")
    if len(found) < needed:
        refuse(path, f"expected {needed:,} bytes of {count:,} splats, as the header says, got {len(found):,}",
               "the file is cut short")
    return np.frombuffer(found, np.uint8)


def _fixed(columns: np.ndarray) -> np.ndarray:
    """(N, 3) float32 of signed numbers of 24 bits, the lowest byte first."""
    low, middle, high = np.moveaxis(columns.reshape(len(columns), 3, 3).astype(np.int32), 2, 0)
    return ((low | middle << 8 | high << 16) ^ 0x800000).astype(np.float32) - np.float32(0x800000)


def _three(columns: np.ndarray) -> np.ndarray:
    """(N, 4) quaternions w, x, y, z whose w, at least 0, is left out."""
    xyz = columns / np.float32(127.5) - 1
    return np.concatenate([np.sqrt(np.maximum(1 - (xyz**2).sum(1, keepdims=True), 0)), xyz], axis=1)


def _smallest_three(columns: np.ndarray) -> np.ndarray:
    """(N, 4) quaternions w, x, y, z whose largest component, above 0, is left out: two bits say which of x, y, z, w it
    is, and the others have a sign and nine bits each, the last of them lowest."""
    packed = np.ascontiguousarray(columns).view("<u4")[:, 0]
    largest = (packed >> 30).astype(np.int64)
    xyzw = np.zeros((len(packed), 4), np.float32)
    shift = np.zeros(len(packed), np.uint32)
    for axis in (3, 2, 1, 0):
        there = largest != axis
        bits = packed >> shift
        size = (bits & 511) / np.float32(511 * np.sqrt(2))
        xyzw[:, axis] = np.where(there, np.where(bits & 512, -size, size), 0)
        shift += np.where(there, 10, 0).astype(np.uint32)
    rest = np.sqrt(np.maximum(1 - (xyzw**2).sum(axis=1), 0))
    xyzw[np.arange(len(packed)), largest] = rest
    return np.roll(xyzw, 1, axis=1)
