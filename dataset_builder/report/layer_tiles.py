"""All layers of an example at full size as one picture, for people without a browser."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.label.mean_told import mean_told
from dataset_builder.layers import LAYERS, RADIANCE
from dataset_builder.report.dataset_summary import cell_pixels
from dataset_builder.report.gallery.example_payload import look, relative_errors
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
    images = {name: example[name] for name in LAYERS if name in example}
    factor = exposure(np.nan_to_num(image) for name, image in images.items() if look(name) == "light")
    errors = relative_errors(example.get("meta", {}))
    width = next(iter(images.values())).shape[1]
    times = max(1, SMALL // width)
    columns = max(1, (WIDEST + SPACE) // (times * width + SPACE))
    label = example.get("meta", {})
    denoised = {*label.get("plan", {}).get("render", {}).get("denoise", ()),
                *(each["layer"] for each in label.get("record", {}).get("denoised", ()))}
    means = {layer["name"]: mean_told(layer) for layer in label.get("record", {}).get("layers", ())}
    tiles = [layer_tile(name, image, factor, errors.get(name), times, mean=means.get(name, ""),
                        denoised=name in denoised)
             for name, image in images.items()]
    rows = [tiles[start:start + columns] for start in range(0, len(tiles), columns)]
    zoom = f"; every pixel {times} times as large" if times > 1 else ""
    return tiled([*title, f"light at exposure {factor:.4g}, sRGB{zoom}"], rows)


def layer_tile(name: str, image: np.ndarray, factor: float, error: float | None, times: int, *, mean: str = "",
               denoised: bool = False) -> Tile:
    """One layer. image: (H, W, C); factor: the exposure of light; error: its relative error, if known; times: how many
    times as large every pixel is; mean: what is said of the layer's mean."""
    layer, kind = LAYERS[name], look(name)
    unit = UNITS.get(layer.unit, layer.unit)
    finite = image[np.isfinite(image)]
    lines = [] if kind in ("number", "direction") or not finite.size else [
        f"{finite.min():.4g} to {finite.max():.4g} {unit}".rstrip() + f", mean {finite.mean():.4g}"]
    if broken := image.size - finite.size:
        lines.append(f"{broken} values are infinite or no number")
    image = np.nan_to_num(image)
    if error is not None:
        lines.append(f"relative error {error:.2%}{', before denoising' if denoised else ''}")
    elif denoised:
        lines.append("denoised")
    if mean:
        lines.append(mean)
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
