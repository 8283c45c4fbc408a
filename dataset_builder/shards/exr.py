"""One layer as one EXR file: single part, scanline, ZIP, lossless; root R, G, B (three channels) or Y (one).

OpenEXR is trusted with nothing. Its Python binding writes wrong pixels, without an error, for arrays that are not
contiguous, reads past the buffer of (H, W, 1) arrays, and opens truncated files as files without parts. So shapes and
types are checked before, every channel is copied, and whatever was encoded is decoded and compared before it is used.
"""

from dataclasses import dataclass
from io import BytesIO
from typing import Any, Literal

import numpy as np
import OpenEXR

from dataset_builder.errors import Problem, ShardError
from dataset_builder.layers import LAYERS

DType = Literal["float32", "float16"]
DTYPES: tuple[DType, ...] = ("float32", "float16")

CODECS = {
    "none": OpenEXR.NO_COMPRESSION, "rle": OpenEXR.RLE_COMPRESSION, "zips": OpenEXR.ZIPS_COMPRESSION,
    "zip": OpenEXR.ZIP_COMPRESSION, "piz": OpenEXR.PIZ_COMPRESSION, "zstd": OpenEXR.ZSTD_COMPRESSION,
    "htj2k32": OpenEXR.HTJ2K32_COMPRESSION, "htj2k256": OpenEXR.HTJ2K256_COMPRESSION,
}
"""Every codec of OpenEXR that keeps both types bit by bit; datasets are written with `zip`, which all readers know."""

VERSION: str = OpenEXR.__version__
SCHEMA = "1"
NAMESPACE = "3df-lighting"
HALF_MAX = 65504.0
MAX_SIDE = 16384
CHANNELS = {1: ("Y",), 3: ("R", "G", "B")}
SCENE = "lin_rec709_scene"
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


@dataclass(frozen=True, kw_only=True)
class ExrImage:
    """A decoded file."""

    planes: np.ndarray
    """(C, H, W), R, G, B or Y, as stored."""
    dtype: DType
    layer: str
    """What its header says it holds."""
    key: str
    """Of the example that its header names."""

    @property
    def pixels(self) -> np.ndarray:
        """(H, W, C) float32, a copy."""
        channels, height, width = self.planes.shape
        pixels = np.empty((height, width, channels), np.float32)
        # Four times as fast as one transposed copy
        for channel, plane in enumerate(self.planes):
            pixels[:, :, channel] = plane
        return pixels


def colour_space(layer: str) -> str:
    """`lin_rec709_scene` for colours, `data` for everything else: identifiers of the Color Interop Forum."""
    return SCENE if LAYERS[layer].channels == 3 and not layer.startswith("normal") else "data"


def stored(array: np.ndarray, *, layer: str, key: str, dtype: DType) -> np.ndarray:
    """What `array` reads as after storage: (H, W, C) float32, C-contiguous, rounded to `dtype`.

    Raises ShardError where the array is not (H, W, C) float32 with the layer's channels, is empty, holds NaN or Inf, or
    (float16) a value beyond +-65504. Nothing is ever clipped.
    """
    return _checked(array, where=f"example {key}, layer {layer}", channels=LAYERS[layer].channels, dtype=dtype)


def _checked(array: np.ndarray, *, where: str, channels: int, dtype: DType) -> np.ndarray:
    if array.dtype != np.float32:
        raise _wrong(where, f"expected float32 pixels, got {array.dtype}")
    if array.ndim != 3 or array.shape[2] != channels or not all(0 < side <= MAX_SIDE for side in array.shape[:2]):
        raise _wrong(where, f"expected shape (H, W, {channels}), got {array.shape}")
    if bad := int(np.count_nonzero(~np.isfinite(array))):
        raise _wrong(where, f"expected finite values, got {bad} that are NaN or Inf")
    if dtype == "float16" and (largest := float(np.abs(array).max())) > HALF_MAX:
        raise _wrong(where, f"expected |x| <= {HALF_MAX:g} to store as float16, got {largest:g}")
    return np.ascontiguousarray(array.astype(dtype).astype(np.float32))


def encode(array: np.ndarray, *, layer: str, key: str, dtype: DType) -> bytes:
    """The file of one layer of example `key`: (H, W, C) float32 in, bytes out, the same bytes every time.

    Raises ShardError as `stored` does, and where the encoded file does not decode to the same bits.
    """
    pixels = stored(array, layer=layer, key=key, dtype=dtype)
    data = compress(pixels, layer=layer, key=key, dtype=dtype)
    if decode(data, where=f"example {key}, layer {layer}").tobytes() != pixels.tobytes():
        raise _wrong(f"example {key}, layer {layer}", "expected the encoded file to decode to the same pixels")
    return data


def encode_picture(array: np.ndarray, *, name: str) -> bytes:
    """The file of a picture that is no layer of an example: (H, W, 3) float32 linear light in, bytes out.

    Its header calls it `name`. Raises ShardError as `encode` does.
    """
    where = f"picture {name}"
    pixels = _checked(array, where=where, channels=3, dtype="float32")
    data = _written(pixels, _header(name, "", "zip", SCENE), "float32")
    if decode(data, where=where).tobytes() != pixels.tobytes():
        raise _wrong(where, "expected the encoded file to decode to the same pixels")
    return data


def compress(pixels: np.ndarray, *, layer: str, key: str, dtype: DType, codec: str = "zip") -> bytes:
    """The file of what `stored` gave, by one of `CODECS`; not read back, as `encode` does."""
    return _written(pixels, _header(layer, key, codec, colour_space(layer)), dtype)


def _written(pixels: np.ndarray, header: dict[str, Any], dtype: DType) -> bytes:
    planes = {name: np.ascontiguousarray(pixels[:, :, i].astype(dtype))
              for i, name in enumerate(CHANNELS[pixels.shape[2]])}
    stream = BytesIO()
    OpenEXR.File(header, planes).write(stream)
    return stream.getvalue()


def decode(data: bytes, *, where: str = "EXR") -> np.ndarray:
    """Pixels of a file, (H, W, C) float32 with C = 3 (R, G, B) or 1 (Y). Raises ShardError as `read` does."""
    return read(data, where=where).pixels


def read(data: bytes, *, where: str = "EXR", most: int = MAX_SIDE) -> ExrImage:
    """Pixels and labels of a file whose sides are at most `most`; what asks for more is not decoded.

    Raises ShardError that names `where` and what is wrong: unreadable, cut short, more than one part, other channels
    than R, G, B or Y, a window that is not the whole picture, another type than float32 or float16, or channels that
    differ in type or from the window's shape.
    """
    header, names, planes = _open(data, where, most)
    window, frame = (tuple(tuple(map(int, corner)) for corner in header[name])
                     for name in ("dataWindow", "displayWindow"))
    if window != frame:
        raise _wrong(where, f"expected pixels of the whole picture {frame}, got those of the window {window}",
                     "save it without crop or overscan")
    (left, top), (right, bottom) = window
    shape = (bottom - top + 1, right - left + 1)
    if wrong := [name for name in names if planes[name].shape != shape]:
        raise _wrong(where, f"expected shape {shape}, got {planes[wrong[0]].shape} in channel {wrong[0]}")
    types = {planes[name].dtype for name in names}
    dtype = next((dtype for dtype in DTYPES if types == {np.dtype(dtype)}), None)
    if dtype is None:
        raise _wrong(where, f"expected float32 or float16 in every channel, got {', '.join(sorted(map(str, types)))}")
    return ExrImage(planes=np.array([planes[name] for name in names]), dtype=dtype,
                    layer=str(header.get(f"{NAMESPACE}:layer", "")), key=str(header.get(f"{NAMESPACE}:key", "")))


def most_side(width: int, height: int) -> int:
    """The longest side to decode where `width` x `height` is expected: enough to name a wrong size, and no more."""
    return 2 * max(width, height)


def _header(layer: str, key: str, codec: str, space: str) -> dict[str, Any]:
    header: dict[str, Any] = {
        "compression": CODECS[codec], "type": OpenEXR.scanlineimage, "colorInteropID": space,
        f"{NAMESPACE}:schema": SCHEMA, f"{NAMESPACE}:layer": layer, f"{NAMESPACE}:key": key,
    }
    return header if header["colorInteropID"] == "data" else {**header, "chromaticities": REC709}


def _open(data: bytes, where: str, most: int) -> tuple[dict[str, Any], tuple[str, ...], dict[str, np.ndarray]]:
    try:
        # A damaged window, or channels by the hundred, could ask for all memory: look at the header first
        file = OpenEXR.File(BytesIO(data), separate_channels=True, header_only=True)
        header = file.header(0)
        low, high = header["dataWindow"]
        if len(file.parts) > 1:
            raise _wrong(where, f"expected one part, got {len(file.parts)}")
        if not all(0 <= int(b) - int(a) < most for a, b in zip(low, high, strict=True)):
            raise _wrong(where, f"expected sides of at most {most}, got the window {low} to {high}")
        given = {channel.name for channel in header["channels"]}
        names = next((names for names in CHANNELS.values() if set(names) == given), None)
        if names is None:
            raise _wrong(where, f"expected channels R, G, B or Y, got {', '.join(sorted(given)) or 'none'}",
                         "save colours as R, G, B of one layer, without alpha")
        file = OpenEXR.File(BytesIO(data), separate_channels=True)
        if len(file.parts) != 1:
            raise _wrong(where, f"expected one part, got {len(file.parts)}: the file is truncated or not ours")
        return file.header(0), names, {name: channel.pixels for name, channel in file.channels(0).items()}
    except (RuntimeError, ValueError, TypeError, IndexError, KeyError, MemoryError) as error:
        raise _wrong(where, f"expected an EXR file, got {len(data)} bytes that do not decode ({error})") from error


def _wrong(where: str, rule: str, hint: str = "") -> ShardError:
    return ShardError([Problem(where=where, path="", rule=rule, hint=hint)])
