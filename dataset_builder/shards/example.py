"""An example as the members of a shard: one EXR per layer, a label, and a preview.

Pillow is imported where it is needed: readers of layers and labels do without.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

from dataset_builder.digest import pixel_digest, sha256_bytes
from dataset_builder.errors import Problem, ShardError
from dataset_builder.label.example_label import ExampleLabel, RenderRecord
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import LAYERS
from dataset_builder.shards import exr
from dataset_builder.shards.label_text import SCHEMA_VERSION, encode_label, statistics
from dataset_builder.tonemap import side_by_side

PREVIEW_LAYERS = ("i_s", "i_t")
LABEL, PREVIEW = "json", "preview.png"
PNG_LEVEL = 6


@dataclass(frozen=True, kw_only=True)
class Example:
    """One finished example."""

    plan: ExamplePlan
    record: RenderRecord
    layers: Mapping[str, np.ndarray]
    """Name -> (H, W, C) float32."""

    @property
    def key(self) -> str:
        """Eight digits, the plan's."""
        return self.plan.key


@dataclass(frozen=True, kw_only=True)
class Member:
    """One file of a shard."""

    name: str
    data: bytes
    pixel_digest: str
    """Of the decoded pixels; empty where there are none."""

    def record(self) -> dict[str, Any]:
        """Name, size, SHA-256 and pixel digest, as the index of a shard lists them."""
        return {"name": self.name, "size": len(self.data), "sha256": sha256_bytes(self.data),
                "pixel_digest": self.pixel_digest}


def encode_members(example: Example, *, dtype: exr.DType, preview_png: bytes) -> list[Member]:
    """Every member of an example, sorted by name; the set of names depends on the example's layers alone.

    Raises ShardError where a layer is unknown, differs in size from the others or cannot be stored as it is, and where
    the label holds what JSON readers would change.
    """
    kept = _kept(example, dtype)
    members = [Member(name=f"{example.key}.{name}.exr", pixel_digest=pixel_digest(array),
                      data=exr.encode(array, layer=name, key=example.key, dtype=dtype)) for name, array in kept.items()]
    members.append(Member(name=f"{example.key}.{LABEL}", data=encode_label(label(example, kept)), pixel_digest=""))
    members.append(Member(name=f"{example.key}.{PREVIEW}", data=preview_png,
                          pixel_digest=pixel_digest(decode_png(preview_png))))
    return sorted(members, key=lambda member: member.name)


def as_read(example: Example, *, dtype: exr.DType) -> dict[str, Any]:
    """What `Dataset` gives for the example once it is stored: layers by name, the label under `meta`.

    Raises ShardError as `encode_members` does.
    """
    kept = _kept(example, dtype)
    return {**kept, "meta": json.loads(encode_label(label(example, kept)))}


def _kept(example: Example, dtype: exr.DType) -> dict[str, np.ndarray]:
    _check_layers(example)
    return {name: exr.stored(array, layer=name, key=example.key, dtype=dtype) for name, array in example.layers.items()}


def label(example: Example, kept: Mapping[str, np.ndarray]) -> ExampleLabel:
    """The label of an example whose layers read as `kept` after storage."""
    return ExampleLabel(schema_version=SCHEMA_VERSION, key=example.key, index=example.plan.index,
                        split=example.plan.split, plan=example.plan, record=example.record,
                        layers={name: statistics(array) for name, array in kept.items()})


def preview(layers: Mapping[str, np.ndarray]) -> bytes:
    """PNG of i_s and i_t side by side, or of whichever there is, else of the first layer; one exposure for both."""
    from PIL import Image

    shown = [layers[name] for name in PREVIEW_LAYERS if name in layers] or [next(iter(layers.values()))]
    stream = BytesIO()
    Image.fromarray(side_by_side(shown)).save(stream, "PNG", compress_level=PNG_LEVEL)
    return stream.getvalue()


def decode_png(data: bytes, *, where: str = "preview", most: int = 2 * exr.MAX_SIDE) -> np.ndarray:
    """Pixels of an 8-bit RGB PNG, (H, W, 3) uint8, whose sides are at most `most`; what asks for more is not decoded.

    Raises ShardError where it does not decode to that.
    """
    from PIL.PngImagePlugin import PngImageFile

    try:
        # `Image.open` has a limit of its own, which pictures of large datasets exceed
        with PngImageFile(BytesIO(data)) as image:
            if max(image.size) > most:
                raise ValueError(f"sides of {image.width} and {image.height}, more than {most}")
            pixels = np.asarray(image)
    except (OSError, SyntaxError, ValueError) as error:
        raise ShardError([Problem(where=where, path="", rule=f"expected a PNG file, got {error}")]) from error
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ShardError([Problem(where=where, path="", rule=f"expected 8-bit RGB, got shape {pixels.shape}")])
    return pixels


def _check_layers(example: Example) -> None:
    where = f"example {example.key}"
    if not example.layers or (unknown := sorted(set(example.layers) - set(LAYERS))):
        rule = f"expected layers among {', '.join(LAYERS)}, got {', '.join(unknown) if example.layers else 'none'}"
        raise ShardError([Problem(where=where, path="layers", rule=rule)])
    if len(sizes := {array.shape[:2] for array in example.layers.values()}) > 1:
        raise ShardError([Problem(where=where, path="layers", rule=f"expected one size, got {sorted(sizes)}")])
