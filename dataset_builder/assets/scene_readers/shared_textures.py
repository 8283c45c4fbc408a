"""Materials that name one image share its texels: a kit of furniture has one picture under a hundred names."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from dataset_builder.assets.asset import Asset, Material, Texture
from dataset_builder.assets.scene_model import SceneThing


def sharing_textures(things: Sequence[SceneThing]) -> tuple[SceneThing, ...]:
    """The things; of textures that are equal to the bit, only the first is kept, and assets that were one stay one."""
    shared, alike = dict[int, Texture](), defaultdict[tuple[object, ...], list[Texture]](list)
    for texture in {id(each.texture): each.texture for thing in things for each in thing.asset.materials}.values():
        if texture is not None:
            known = alike[_probe(texture)]
            shared[id(texture)] = next((other for other in known if _equal(texture, other)), texture)
            if shared[id(texture)] is texture:
                known.append(texture)
    assets = {id(thing.asset): _with(thing.asset, shared) for thing in things}
    return tuple(replace(thing, asset=assets[id(thing.asset)]) if assets[id(thing.asset)] is not thing.asset else thing
                 for thing in things)


def _with(asset: Asset, shared: dict[int, Texture]) -> Asset:
    made = [_sharing(material, shared) for material in asset.materials]
    same = all(one is other for one, other in zip(made, asset.materials, strict=True))
    return asset if same else replace(asset, materials=tuple(made))


def _sharing(material: Material, shared: dict[int, Texture]) -> Material:
    kept = None if material.texture is None else shared[id(material.texture)]
    return material if kept is material.texture else replace(material, texture=kept)


def _probe(texture: Texture) -> tuple[object, ...]:
    """What equal textures have in common, found at a glance: their shape, and the row in the middle."""
    maps = _maps(texture)
    return (texture.wrap, texture.nearest, texture.base_color.shape, *maps,
            *(values[len(values) // 2].tobytes() for values in maps.values()))


def _equal(one: Texture, other: Texture) -> bool:
    return all(np.array_equal(values, getattr(other, name)) for name, values in _maps(one).items())


def _maps(texture: Texture) -> dict[str, np.ndarray]:
    found = {each.name: getattr(texture, each.name) for each in fields(texture)}
    return {name: value for name, value in found.items() if isinstance(value, np.ndarray)}
