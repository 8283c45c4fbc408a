"""All layers of an example at full size as one picture, for people without a browser."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.layers import LAYERS, RADIANCE
from dataset_builder.report.dataset_summary import cell_pixels
from dataset_builder.report.gallery.example_payload import look
from dataset_builder.report.picture_tiles import SPACE, ColourBar, Tile, coloured, colours_of, tiled
from dataset_builder.tonemap import exposure

WIDEST = 1500
"""Pixels that pictures beside each other take."""
SMALL = 320
"""Layers that are less wide are shown larger, by a whole number."""
MAPS = {"error": "magma", "length": "viridis"}
ENDS = {"error": (None, 99.0), "length": (0.5, 99.5)}
"""Percentiles of the values above 0 at the ends of a map; None is 0. The same as in the browser."""
UNITS = {RADIANCE: "W/m^2/sr", "1": "", "id": ""}


def layer_tiles(example: Mapping[str, Any], title: Sequence[str]) -> Image.Image:
    """The picture. example: layers by name, (H, W, C) floats, and the label under `meta`, as JSON, if there is one.

    Light has one exposure and the sRGB curve; standard errors and lengths are in false colour, each with its bar.
    """
    images = {name: np.nan_to_num(example[name]) for name in LAYERS if name in example}
    factor = exposure(image for name, image in images.items() if look(name) == "light")
    record = example.get("meta", {}).get("record", {})
    errors = {layer["name"]: layer["relative_error"] for layer in record.get("layers", ())}
    width = next(iter(images.values())).shape[1]
    times = max(1, SMALL // width)
    columns = max(1, (WIDEST + SPACE) // (times * width + SPACE))
    planned = example.get("meta", {}).get("plan", {}).get("render", {}).get("denoise", ())
    denoised = {*planned, *(layer["layer"] for layer in record.get("denoised", ()))}
    tiles = [_tile(name, image, factor, errors.get(name), times, denoised=name in denoised)
             for name, image in images.items()]
    rows = [tiles[start:start + columns] for start in range(0, len(tiles), columns)]
    zoom = f"; every pixel {times} times as large" if times > 1 else ""
    return tiled([*title, f"light at exposure {factor:.4g}, sRGB{zoom}"], rows)


def _tile(name: str, image: np.ndarray, factor: float, error: float | None, times: int, *,
          denoised: bool) -> Tile:
    layer, kind = LAYERS[name], look(name)
    unit = UNITS.get(layer.unit, layer.unit)
    lines = [] if kind in ("number", "direction") else [
        f"{image.min():.4g} to {image.max():.4g} {unit}".rstrip() + f", mean {image.mean():.4g}"]
    if error is not None:
        lines.append(f"relative error {error:.2%}{', before denoising' if denoised else ''}")
    elif denoised:
        lines.append("denoised")
    if kind == "light" and (below := int(np.count_nonzero(image < 0))):
        lines.append(f"{below} values below 0 are shown as 0")
    bar = None
    if kind in MAPS:
        low, high = _ends(image, kind)
        bar = ColourBar(colours=colours_of(MAPS[kind]), scales=[(low, high, unit)])
        values = image.max(axis=2)
        pixels = coloured(values, low, high, bar.colours)
        if kind == "length":
            pixels = np.where(values[..., None] > 0, pixels, 0).astype(np.uint8)
    else:
        pixels = cell_pixels(name, image, factor)
    return Tile(title=f"{name}   {layer.symbol}", pixels=pixels.repeat(times, axis=0).repeat(times, axis=1),
                lines=lines, bar=bar)


def _ends(image: np.ndarray, kind: str) -> tuple[float, float]:
    """Values at the ends of a map."""
    some = image[image > 0]
    low, high = (0.0 if share is None else float(np.percentile(some, share)) if some.size else float(place)
                 for place, share in enumerate(ENDS[kind]))
    return low, high
