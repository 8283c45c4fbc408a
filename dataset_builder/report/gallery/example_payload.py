"""The payload of an example: all that a page shows of it, as plain data that a browser can read.

Pixels are half floats, so that exposure, false colour and the value under the pointer are worked out from linear light.
"""

import math
import zlib
from base64 import b64encode
from collections.abc import Mapping
from typing import Any

import numpy as np

from dataset_builder.errors import count_of
from dataset_builder.label.denoised_words import told_bias
from dataset_builder.label.example_label import Denoised
from dataset_builder.label.mean_told import mean_told
from dataset_builder.layers import LAYERS, RADIANCE

HALF_MAX = 65504.0
"""The largest half float."""
LEVEL = 6
"""Of zlib's compression."""

Payload = dict[str, Any]


def example_payload(example: Mapping[str, Any], *, key: str = "", title: str = "", note: str = "") -> Payload:
    """The payload of an example as a dataset or `render_example` gives it: layers by name, (H, W, C) floats of one
    size, and the label under `meta`, if there is one.

    Layers are in the order of the table of layers. `data` is base64 of zlib's stream of (C, H, W) little-endian half
    floats, rounded to the nearest; `cut` counts values beyond 65504, which are stored as that. note: shown beside the
    title. Raises KeyError where a layer is not in the table.
    """
    errors = relative_errors(example.get("meta", {}))
    label = _plain(example.get("meta", {}))
    images = {name: pixels for name, pixels in example.items() if name != "meta"}
    order = {name: place for place, name in enumerate(LAYERS)}
    height, width = next(iter(images.values())).shape[:2]
    record = label.get("record", {})
    denoised = {layer["layer"]: trust(layer) for layer in record.get("denoised", ())}
    means = {layer["name"]: mean_told(layer) for layer in record.get("layers", ())}
    doubtful = {layer["name"] for layer in record.get("layers", ()) if layer.get("mean_known", "known") != "known"}
    planned = label.get("plan", {}).get("render", {}).get("denoise", ())
    layers = [{**layer_facts(name), "error": errors.get(name), **half_floats(images[name]),
               "mean": means.get(name, ""), "doubtful": name in doubtful,
               "denoised": denoised.get(name, "denoised; not measured" if name in planned else "")}
              for name in sorted(images, key=order.__getitem__)]
    shown = key or str(label.get("key", ""))
    return {"key": shown, "width": width, "height": height, "title": title or shown, "note": note, "label": label,
            "layers": layers}


def layer_facts(name: str) -> dict[str, Any]:
    """What the table of layers says of a layer, and how it is to be shown."""
    layer = LAYERS[name]
    return {"name": name, "symbol": layer.symbol, "meaning": layer.meaning, "unit": layer.unit,
            "channels": layer.channels, "look": look(name)}


def look(name: str) -> str:
    """How a layer is shown: `error`, `length`, `number`, `light`, `direction` or `share`."""
    layer = LAYERS[name]
    if name.endswith("_se"):
        return "error"
    by_unit = {"m": "length", "id": "number", RADIANCE: "light"}.get(layer.unit)
    return by_unit or ("direction" if layer.low < 0 else "share")


def relative_errors(label: Mapping[str, Any]) -> dict[str, float]:
    """Relative error of each layer that has a finite one, from the record of a label as JSON, which may lack."""
    return {layer["name"]: layer["relative_error"] for layer in label.get("record", {}).get("layers", ())
            if math.isfinite(layer["relative_error"])}


def half_floats(pixels: np.ndarray) -> dict[str, Any]:
    """`data` and `cut` of (H, W, C) pixels."""
    planes = np.moveaxis(pixels, 2, 0)
    cut = int(np.count_nonzero(np.abs(planes) > HALF_MAX))
    halves = np.clip(planes, -HALF_MAX, HALF_MAX).astype("<f2")
    return {"data": b64encode(zlib.compress(halves.tobytes(), LEVEL)).decode(), "cut": cut}


def trust(denoised: Mapping[str, Any]) -> str:
    """How far a denoised layer may be trusted, in words. denoised: what a record says of the layer."""
    item = Denoised.model_validate(denoised)
    if item.known == "unknown":
        return "denoised: bias unknown, the object was black in this layer wherever it was measured"
    better = f"squared error {item.relmse_raw:.3g} before, {item.relmse_denoised:.3g} after"
    bias, error, pixel = told_bias(item)
    return f"denoised: bias {bias} ± {error}, of a pixel {pixel}; {better}, of {count_of(item.examples, 'example')}"


def _plain(value: Any) -> Any:
    """The same data without NaN and Inf, which JSON does not have: None is in their place."""
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
