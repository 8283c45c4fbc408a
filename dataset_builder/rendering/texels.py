"""Materials as flat arrays: what the surface plugin gathers from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.assets.asset import Material, Texture

CHANNELS = 8
"""Texel layout: base colour (3), roughness, metallic, normal x, normal y, unused."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialArrays:
    """The materials of one scene.

    factors: (M, 8) float32: base colour (3), roughness,
    metallic, specular, 0, 0. extents: (M, 4) uint32: first texel, width, height, 0. texels: (T, 8) float16.
    """

    factors: np.ndarray
    extents: np.ndarray
    texels: np.ndarray


def pack(materials: Sequence[Material]) -> MaterialArrays:
    """Arrays of `materials`; textures that materials share are stored once."""
    blocks: dict[int, tuple[int, np.ndarray]] = {}
    extents, first = [], 0
    for material in materials:
        key = id(material.texture)
        if key not in blocks:
            block = pack_texture(material.texture)
            blocks[key] = (first, block)
            first += block.shape[0] * block.shape[1]
        start, block = blocks[key]
        extents.append((start, block.shape[1], block.shape[0], 0))
    factors = [(*m.base_color, m.roughness, m.metallic, m.specular, 0, 0) for m in materials]
    return MaterialArrays(factors=np.array(factors, dtype=np.float32).reshape(-1, CHANNELS),
                          extents=np.array(extents, dtype=np.uint32).reshape(-1, 4),
                          texels=np.concatenate([block.reshape(-1, CHANNELS) for _, block in blocks.values()]))


def pack_texture(texture: Texture | None) -> np.ndarray:
    """(H, W, 8) float16 texels of a texture; one white texel for none."""
    if texture is None:
        texture = Texture(base_color=np.ones((1, 1, 3), dtype=np.float32))
    height, width = texture.base_color.shape[:2]
    block = np.zeros((height, width, CHANNELS), dtype=np.float16)
    block[..., :3] = texture.base_color
    block[..., 3] = 1 if texture.roughness is None else texture.roughness
    block[..., 4] = 1 if texture.metallic is None else texture.metallic
    if texture.normal is not None:
        block[..., 5:7] = texture.normal[..., :2]
    return block
