"""One EXR per example with all layers, for compositors: Nuke, Blender, Fusion, OpenImageIO.

Channels are `LAYER.C` as OpenEXR has it; one colour layer is at the root as R, G, B, so that programs without layers
show it. Blender takes what is before the last dot for a pass; Nuke takes it for a layer, `depth.Z` for its own depth.
"""

from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from dataset_builder.errors import Problem, ShardError
from dataset_builder.exporting.formats.source_shard import ExportFile, SourceRow, SourceShard, write_file
from dataset_builder.layers import LAYERS
from dataset_builder.shards import exr

SHOWN = ("i_t", "i_s")
"""Layers that are shown at the root, the first that there is; else the first colour layer."""


def write_shard(shard: SourceShard, out: Path) -> Iterator[ExportFile]:
    """Two files for each example: `SPLIT/KEY.exr` and its label, `SPLIT/KEY.json`."""
    for row in shard.rows():
        path = f"{shard.split}/{row.example.key}"
        yield write_file(out, f"{path}.exr", [encode_layers(_images(row), key=row.example.key)], examples=1)
        yield write_file(out, f"{path}.json", [row.label], examples=0)


def channel_names(layer: str) -> tuple[str, ...]:
    """The channels of a layer in a file of many: colours are R, G, B, directions X, Y, Z, depth Z, coverage A."""
    if LAYERS[layer].channels == 3:
        return tuple(f"{layer}.{one}" for one in ("RGB" if exr.colour_space(layer) == exr.SCENE else "XYZ"))
    return (f"{layer}.{'Z' if layer == 'depth' else 'A' if layer.startswith('mask') else 'Y'}",)


def root_layer(layers: Mapping[str, object]) -> str:
    """The layer at the root; empty where no layer has colours."""
    colours = [name for name in layers if exr.colour_space(name) == exr.SCENE]
    return next((name for name in (*SHOWN, *colours) if name in layers), "")


def encode_layers(images: Mapping[str, exr.ExrImage], *, key: str) -> bytes:
    """The file of an example's layers, each as it is stored, bit by bit. Raises ShardError where it does not decode to
    the same."""
    root, planes = root_layer(images), dict[str, np.ndarray]()
    for layer, image in images.items():
        names = exr.CHANNELS[3] if layer == root else channel_names(layer)
        planes |= {name: np.ascontiguousarray(plane) for name, plane in zip(names, image.planes, strict=True)}
    header: dict[str, Any] = {
        "compression": exr.CODECS["zip"], "type": OpenEXR.scanlineimage, "chromaticities": exr.REC709,
        "colorInteropID": exr.SCENE, f"{exr.NAMESPACE}:schema": exr.SCHEMA, f"{exr.NAMESPACE}:key": key,
        f"{exr.NAMESPACE}:root": root,
    }
    stream = BytesIO()
    # The binding changes the dictionaries that it is given
    OpenEXR.File(header, dict(planes)).write(stream)
    data = stream.getvalue()
    found = {name: channel.pixels for name, channel in
             OpenEXR.File(BytesIO(data), separate_channels=True).channels(0).items()}
    if {name: (one.dtype, one.tobytes()) for name, one in found.items()} != {
            name: (one.dtype, one.tobytes()) for name, one in planes.items()}:
        raise ShardError([Problem(where=f"example {key}", path="",
                                  rule="expected the encoded file to decode to the same pixels")])
    return data


def _images(row: SourceRow) -> dict[str, exr.ExrImage]:
    return {name: exr.read(data, where=f"example {row.example.key}, layer {name}")
            for name, data in row.layers.items()}
