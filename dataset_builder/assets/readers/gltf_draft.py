"""A material of a glTF file while its parts are gathered: factors, maps that share one layout, and what is left out."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dataset_builder.assets.asset import Wrap
from dataset_builder.assets.readers.gltf_images import GltfImages
from dataset_builder.assets.readers.gltf_values import Entry

TRANSFORM = "KHR_texture_transform"
WRAPS: dict[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
NEAREST, FILTERS = 9728, (9728, 9729)
UPWARDS = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
"""Texture coordinates with v downwards, as in the file, to ours and back."""
ROUNDING = 1e-6
"""Of numbers at the limit of their range, not worth a word."""
Colour = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class MapLayout:
    """How a map lies on the surface."""

    uv_set: int
    transform: np.ndarray
    """(2, 3) in our convention, v upwards."""
    wrap: tuple[Wrap, Wrap]
    nearest: bool

    def covers(self, other: "MapLayout") -> bool:
        """Whether another map lies on the surface in the same way, edges and filter apart."""
        return self.uv_set == other.uv_set and np.allclose(self.transform, other.transform)

    def samples(self, other: "MapLayout") -> bool:
        """Whether another map has the same edges and filter."""
        return (self.wrap, self.nearest) == (other.wrap, other.nearest)


@dataclass(kw_only=True, eq=False)
class Draft:
    """What is known of a material so far. Methods raise UserError."""

    entry: Entry
    images: GltfImages
    factors: dict[str, Any] = field(default_factory=dict)
    """Fields of Material."""
    maps: dict[str, np.ndarray] = field(default_factory=dict)
    """Fields of Texture, (H, W) or (H, W, 3); normals as encoded."""
    left_out: list[str] = field(default_factory=list)
    layout: MapLayout | None = None
    """Of the first map, which all others have to follow."""
    sources: dict[str, str] = field(default_factory=dict)
    """Digests of the images of the maps, by the keys that name them."""

    def share(self, place: Entry, key: str, default: float, *, high: float = 1.0) -> float:
        """A number in [0, high]; what is beyond is said and taken as the limit."""
        found = place.number(key, default)
        taken = min(max(found, 0.0), high)
        if abs(taken - found) > ROUNDING:
            self.left_out.append(f"{key} {found:g}, taken as {taken:g}")
        return taken

    def colour(self, place: Entry, key: str, default: Colour, *, high: float = 1.0) -> Colour:
        """Three numbers in [0, high], as `share` takes them."""
        found = place.numbers(key, default)
        taken = np.clip(found, 0, high)
        if (abs(taken - found) > ROUNDING).any():
            self.left_out.append(f"{key} {found.tolist()}, taken as {taken.tolist()}")
        red, green, blue = taken.tolist()
        return red, green, blue

    def texels(self, place: Entry, key: str, *, srgb: bool = False) -> np.ndarray | None:
        """(H, W, 4) of a texture that `place` names; None without. One that lies otherwise than the material's first is
        replaced by its mean, a single texel."""
        if not place.has(key):
            return None
        info = place.entry(key)
        textures = self.images.gltf.lists["textures"]
        number = info.index("index", textures, "textures")
        if number is None:
            info.refuse("expected an index, the key is missing")
        texels, layout = self.images.texels(textures[number], srgb=srgb), self._layout(info, textures[number])
        self.sources[key] = self.images.digests[self.images.image_of(textures[number])]
        if self.layout is None:
            self.layout = layout
        if not self.layout.covers(layout):
            self.left_out.append(f"{key}, which lies otherwise than the other maps: its mean instead")
            return texels.mean(axis=(0, 1), dtype=np.float64, keepdims=True).astype(np.float32)
        if not self.layout.samples(layout):
            self.left_out.append(f"the sampler of {key}, which differs from the other maps'")
        return texels

    def _layout(self, info: Entry, texture: Entry) -> MapLayout:
        samplers = self.images.gltf.lists["samplers"]
        number = texture.index("sampler", samplers, "samplers")
        sampler = Entry({}, texture.at, texture.path) if number is None else samplers[number]
        across, along = (self._wrap(sampler, key) for key in ("wrapS", "wrapT"))
        magnified = sampler.integer("magFilter", FILTERS[1])
        found = info.extension(TRANSFORM)
        uv_set = info.integer("texCoord", 0, high=99)
        uv_set = uv_set if found is None else found.integer("texCoord", uv_set, high=99)
        return MapLayout(uv_set=uv_set, transform=_transform(found), wrap=(across, along), nearest=magnified == NEAREST)

    def _wrap(self, sampler: Entry, key: str) -> Wrap:
        code = sampler.integer(key, 10497)
        if code not in WRAPS:
            sampler.refuse(f"expected one of {', '.join(map(str, WRAPS))}, got {code}", key=key)
        return WRAPS[code]


def _transform(found: Entry | None) -> np.ndarray:
    """(2, 3) of KHR_texture_transform: scale, then turn, then offset, with v downwards.

    It turns from v to u, as the extension's words, its test model and the other importers have it; the listing there
    has the opposite sign (KhronosGroup/glTF#1563).
    """
    if found is None:
        return np.eye(2, 3)
    offset, scale = found.numbers("offset", (0, 0)), found.numbers("scale", (1, 1))
    sine, cosine = np.sin(angle := found.number("rotation", 0)), np.cos(angle)
    matrix = np.array([[cosine * scale[0], sine * scale[1], offset[0]],
                       [-sine * scale[0], cosine * scale[1], offset[1]], [0, 0, 1]])
    return (UPWARDS @ matrix @ UPWARDS)[:2]
