"""Materials as flat arrays: what the surface plugin gathers from.

What cannot be a surface is refused here, by name, since nothing after it would notice: a base colour above one sends
back more light than it gets, and half precision turns what is not finite or huge into infinity.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from dataset_builder.assets.asset import (
    HALF_STEP,
    MORE_MAPS,
    Material,
    Texture,
    coverage_range,
    cutoff_in_half,
    disperses,
    is_mapped,
    is_pane,
    is_solid,
    range_of,
    sends,
)
from dataset_builder.assets.glass_bodies import GlassBody, fill_of, glass_bodies
from dataset_builder.errors import PlanError, Problem
from dataset_builder.rendering.surface.texel_means import averaged

CHANNELS = 8
PLANES: tuple[dict[str, int], ...] = (
    {"base_color": 0, "roughness": 3, "metallic": 4, "normal": 5, "alpha": 7},
    {"emission": 0, "specular": 3, "transmission": 4, "coat": 5, "coat_roughness": 6, "sheen_roughness": 7},
    {"sheen": 0})
"""First channel of every map; of normals x and y alone. A texture has the first plane of texels, or all of them."""

FACTORS = 24
"""Row layout: base colour (3), roughness | metallic, specular, coat, coat roughness | sheen (3), sheen roughness |
transmission, index of refraction, thin, Abbe number | emission (3), alpha | cutoff or -1, number of the body of glass
or 0, unused (2)."""

MIRROR, CLAMP, ALONG_V, NEAREST, MORE = 1, 2, 2, 16, 32
"""Bits that say how a texture is read: at its ends along u, the same `ALONG_V` places higher, between its texels, and
whether it has more planes than one."""

KEPT_TEXELS = 2**14
"""Texels up to which what became of a larger texture is kept: the next view of a house may need the same."""

MAX_TEXELS = 2**29 - 1
"""Texels whose channels 32 bits can count."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialArrays:
    """The materials of one scene."""

    factors: np.ndarray
    """(M, FACTORS) float32."""
    extents: np.ndarray
    """(M, 4) uint32: first texel, width, height, how to read them. A plane of texels follows the one before."""
    texels: np.ndarray
    """(T, CHANNELS) float16."""
    bodies: tuple[GlassBody, ...] = ()
    """Of glass, numbered from 1."""


_known_blocks: WeakKeyDictionary[Texture, dict[tuple[int, int], np.ndarray]] = WeakKeyDictionary()
_known_faults: WeakKeyDictionary[Texture, dict[str, str]] = WeakKeyDictionary()


def pack(materials: Sequence[Material], texture_size: int | Sequence[int] = 4096, sky: float = 1.0) -> MaterialArrays:
    """Arrays of `materials`; textures that materials share are stored once, with sides of at most `texture_size`, which
    may differ by material. sky: radiance of what is sent out per unit of emission.

    Raises PlanError for every factor or texel that is not finite or lies outside its range by more than half precision
    rounds off, naming the material and how many texels; smaller overshoot is clipped.
    """
    check(materials)
    sizes = [texture_size] * len(materials) if isinstance(texture_size, int) else texture_size
    most: dict[int, int] = {}
    for material, size in zip(materials, sizes, strict=True):
        most[id(material.texture)] = max(size, most.get(id(material.texture), 0))
    blocks: dict[int, tuple[int, np.ndarray]] = {}
    extents, first = [], 0
    for material in materials:
        key = id(material.texture)
        if key not in blocks:
            block = pack_texture(material.texture, most[key])
            blocks[key] = (first, block)
            first += block.size // CHANNELS
        start, block = blocks[key]
        extents.append((start, block.shape[2], block.shape[1], _reading(material.texture)))
    if first > MAX_TEXELS:
        raise PlanError(f"textures: expected at most {MAX_TEXELS} texels in a scene, got {first}; lower texture_size")
    bodies = glass_bodies(materials)
    rows = [_row(m, sky, bodies) for m in materials]
    return MaterialArrays(factors=np.array(rows, dtype=np.float32).reshape(-1, FACTORS), bodies=bodies,
                          extents=np.array(extents, dtype=np.uint32).reshape(-1, 4),
                          texels=np.concatenate([block.reshape(-1, CHANNELS) for _, block in blocks.values()]))


def pack_texture(texture: Texture | None, texture_size: int = 4096) -> np.ndarray:
    """(P, H, W, CHANNELS) float16 planes of texels with sides of at most `texture_size`; one white texel for none.

    Larger textures are averaged over boxes, in linear values; of normals, which are averaged as vectors, x and y of
    the mean direction are kept.
    """
    if texture is None:
        return _layout(Texture(base_color=np.ones((1, 1, 3), dtype=np.float32)))
    height, width = texture.base_color.shape[:2]
    factor = texture_size / max(height, width)
    if factor >= 1:
        return _layout(texture)
    size = max(1, round(height * factor)), max(1, round(width * factor))
    known = _known_blocks.setdefault(texture, {})
    if size in known:
        return known[size]
    maps: dict[str, Any] = {name: averaged(values, size) for name, values in _maps(texture).items()}
    if "normal" in maps:
        maps["normal"] /= np.maximum(np.linalg.norm(maps["normal"], axis=2, keepdims=True), 1e-6)
    block = _layout(Texture(**maps))
    if size[0] * size[1] <= KEPT_TEXELS:
        known[size] = block
    return block


def check(materials: Sequence[Material]) -> None:
    """Raise PlanError with everything about `materials` that no surface can have."""
    problems = [problem for material in materials for problem in _problems(material)]
    if problems:
        raise PlanError(problems)


def needs(materials: Sequence[Material]) -> frozenset[str]:
    """Features without which a surface of these materials would not be what they say; see `bsdf.FEATURES`."""
    return frozenset(feature for material in materials for feature in _needs(material))


def _needs(m: Material) -> set[str]:
    opaque = range_of(m, "transmission")[0] < 1
    calls = {"textures": m.texture is not None, "specular": m.metallic > 0 or (m.specular > 0 and opaque),
             "coat": range_of(m, "coat")[1] > 0, "sheen": range_of(m, "sheen")[1] > 0, "glass": is_solid(m),
             "thin": is_pane(m), "dispersion": disperses(m), "nested": fill_of(m) is not None,
             "maps": is_mapped(m), "emission": sends(m),
             "coverage": coverage_range(m)[0] < 1}
    return {feature for feature, called in calls.items() if called}


def _row(m: Material, sky: float, bodies: Sequence[GlassBody]) -> tuple[float, ...]:
    body = fill_of(m)
    cutoff = -1.0 if m.alpha_cutoff is None else cutoff_in_half(m.alpha_cutoff)
    return (*m.base_color, m.roughness, m.metallic, m.specular, m.coat, m.coat_roughness, *m.sheen, m.sheen_roughness,
            m.transmission, m.ior, float(m.thin), m.abbe, *(sky * part for part in m.emission), m.alpha,
            cutoff, 0.0 if body is None else 1.0 + bodies.index(body), 0.0, 0.0)


def _reading(texture: Texture | None) -> int:
    """Bits of how a texture is read."""
    if texture is None:
        return 0
    along_u, along_v = ({"repeat": 0, "mirror": MIRROR, "clamp": CLAMP}[wrap] for wrap in texture.wrap)
    more = any(name in MORE_MAPS for name in _maps(texture))
    return along_u + (along_v << ALONG_V) + NEAREST * texture.nearest + MORE * more


def _layout(texture: Texture) -> np.ndarray:
    maps = _maps(texture)
    planes = PLANES if any(name in MORE_MAPS for name in maps) else PLANES[:1]
    block = np.ones((len(planes), *texture.base_color.shape[:2], CHANNELS), dtype=np.float16)
    block[0, ..., 5:7] = 0
    for plane, places in zip(block, planes, strict=True):
        for name in places.keys() & maps.keys():
            values = maps[name][..., :2] if name == "normal" else np.clip(maps[name], 0, 1)
            width = 1 if values.ndim == 2 else values.shape[2]
            plane[..., places[name]:places[name] + width] = values.reshape(*plane.shape[:2], width)
    return block


def _maps(texture: Texture) -> dict[str, np.ndarray]:
    maps = {name: getattr(texture, name) for places in PLANES for name in places}
    return {name: values for name, values in maps.items() if values is not None}


def _problems(material: Material) -> list[Problem]:
    found = [Problem(where=f"material {material.name!r}", path=name, rule=f"expected {rule}, got {value!r}")
             for name, rule, value, good in _factors(material) if not good]
    if material.texture is not None:
        found += [Problem(where=f"material {material.name!r}", path=f"texture.{name}", rule=rule,
                          hint="correct the texture; values are not clipped automatically")
                  for name, rule in _faults(material.texture).items()]
    return found


def _faults(texture: Texture) -> dict[str, str]:
    """What is wrong with the maps of a texture, found once for as long as it is kept."""
    if texture not in _known_faults:
        _known_faults[texture] = {name: rule for name, values in _maps(texture).items()
                                  if (rule := _broken(name, values))}
    return _known_faults[texture]


def _factors(m: Material) -> list[tuple[str, str, object, bool]]:
    """(name, rule, value, whether it holds) of every factor; NaN holds nowhere."""
    shares = {"roughness": m.roughness, "metallic": m.metallic, "specular": m.specular, "coat": m.coat,
              "coat_roughness": m.coat_roughness, "sheen_roughness": m.sheen_roughness, "transmission": m.transmission,
              "alpha": m.alpha}
    cutoff = m.alpha_cutoff
    colours = {"base_color": m.base_color, "sheen": m.sheen}
    return [*((name, "a share in [0, 1]", value, 0 <= value <= 1) for name, value in shares.items()),
            *((name, "shares in [0, 1]", value, all(0 <= v <= 1 for v in value)) for name, value in colours.items()),
            ("emission", "finite values >= 0", m.emission, all(0 <= v < np.inf for v in m.emission)),
            ("alpha_cutoff", "a finite value >= 0", cutoff, cutoff is None or 0 <= cutoff < np.inf),
            ("priority", "a whole number >= 0, and above 0 only where nothing is cut out (alpha 1)", m.priority,
             m.priority == 0 or (m.priority > 0 and m.priority % 1 == 0 and coverage_range(m)[0] == 1)),
            ("ior", "a finite index of refraction >= 1", m.ior, 1 <= m.ior < np.inf),
            ("abbe", "a finite Abbe number >= 0", m.abbe, 0 <= m.abbe < np.inf)]


def _broken(name: str, values: np.ndarray) -> str:
    """What is wrong with a map, with the count of texels; empty where nothing is."""
    low, rule = (-1, "unit vectors") if name == "normal" else (0, "values in [0, 1]")
    if name != "normal" and values.min() >= low - HALF_STEP and values.max() <= 1 + HALF_STEP:
        return ""
    # Comparing so that NaN counts as broken.
    good = (values >= low - HALF_STEP) & (values <= 1 + HALF_STEP)
    if name == "normal":
        good[..., 0] &= np.sum(np.square(values[..., :2], dtype=np.float32), axis=-1) <= 1 + 4 * HALF_STEP
    bad = ~good if good.ndim == 2 else ~good.all(axis=2)
    if not bad.any():
        return ""
    row, column = np.argwhere(bad)[0]
    return (f"expected {rule}, got {np.count_nonzero(bad)} of {bad.size} texels that are not, the first "
            f"{values[row, column].tolist()} in row {row}, column {column}")
