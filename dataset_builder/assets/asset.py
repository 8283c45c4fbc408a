"""An asset: one mesh, the materials its faces name, and where it comes from; and which materials are glass."""

from dataclasses import dataclass, field
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from dataset_builder.geometry.mesh import TriangleMesh


def reflectance_at(ior: float) -> float:
    """Reflectance at normal incidence that belongs to an index of refraction: ((n - 1) / (n + 1))^2."""
    return ((ior - 1) / (ior + 1)) ** 2


Wrap = Literal["repeat", "mirror", "clamp"]
"""What is beyond the edge of a texture."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Texture:
    """Texel values that multiply the factors of a material.

    All maps share one H and W. Row 0 is at v = 1 (image order); texture coordinate (0, 0) is the lower left corner.
    Values are float32, or float16 in scenes from files, which may have hundreds: the device holds no more.
    """

    base_color: np.ndarray
    """(H, W, 3), linear Rec.709 in [0, 1]."""
    roughness: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    metallic: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    normal: np.ndarray | None = None
    """(H, W, 3) unit vectors in tangent space (x along u, y along v, z out)."""
    alpha: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    emission: np.ndarray | None = None
    """(H, W, 3), linear Rec.709 in [0, 1]."""
    specular: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    transmission: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    coat: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    coat_roughness: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    sheen: np.ndarray | None = None
    """(H, W, 3), linear Rec.709 in [0, 1]."""
    sheen_roughness: np.ndarray | None = None
    """(H, W) in [0, 1]."""
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    """Along u and along v."""
    nearest: bool = False
    """Whether texels are squares of one value, not interpolated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """Metallic-roughness surface, as glTF 2.0 (appendix B) means it, two-sided, with the extensions
    KHR_materials_transmission, _volume, _ior, _dispersion, _clearcoat and _sheen."""

    name: str
    base_color: tuple[float, float, float]
    """Three factors in [0, 1], linear Rec.709; they tint transmitted light, too."""
    roughness: float = 1.0
    """Perceptual, in [0, 1] (alpha = roughness squared)."""
    metallic: float = 0.0
    """In [0, 1]."""
    specular: float = 0.04
    """Reflectance at normal incidence of the dielectric part, in [0, 0.16]; 0.04 is an index of refraction of 1.5, 0
    switches the dielectric's specular lobe off and leaves a Lambertian surface."""
    transmission: float = 0.0
    """Share of the light entering the dielectric that is refracted rather than scattered, in [0, 1]."""
    ior: float = 1.5
    """Index of refraction of the dielectric where it transmits, >= 1."""
    thin: bool = False
    """Whether it is a pane that bends no light."""
    abbe: float = 0.0
    """Abbe number of what transmits, 0 for no dispersion."""
    priority: int = 0
    """Of bodies of solid glass that take the same space, the one of the highest priority owns it; 0 takes no part and
    has air around it."""
    coat: float = 0.0
    """Weight of a clear coat of index 1.5."""
    coat_roughness: float = 0.0
    """Perceptual."""
    sheen: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Colour of the sheen of fibres."""
    sheen_roughness: float = 0.5
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Radiance sent out on both sides, linear Rec.709 >= 0, in units of the source sky's: 1 is as bright as white paper
    under that sky."""
    alpha: float = 1.0
    """Coverage in [0, 1], times the texture's and the vertices': the share of the surface that is there. What is not
    there lets light and sight through unchanged."""
    alpha_cutoff: float | None = None
    """Where set, coverage is 1 where alpha is at least this and 0 elsewhere (glTF 2.0, section 3.9.4, MASK)."""
    texture: Texture | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Asset:
    """What a placed object is made of, in its own frame: metres, Z up, front towards -Y, on the floor (smallest z is 0)
    unless it hangs, centred over the origin in x and y."""

    name: str
    category: str
    mesh: TriangleMesh
    materials: tuple[Material, ...]
    meta: dict[str, str] = field(default_factory=dict)
    """Strings for the record, among them `licence` and `source`."""


HALF_STEP = 2.0**-11
"""Relative step of half precision below one: what a texel may be off without meaning anything by it."""
MORE_MAPS = ("emission", "specular", "transmission", "coat", "coat_roughness", "sheen", "sheen_roughness")
"""Maps that few textures have."""


def range_of(material: Material, name: str) -> tuple[float, float]:
    """Least and largest value of a factor over its texels; of a colour, over its channels."""
    factor = getattr(material, name)
    if material.texture is None or getattr(material.texture, name) is None:
        channels = factor if isinstance(factor, tuple) else (factor,)
        return float(min(channels)), float(max(channels))
    low, high = (np.asarray(factor, dtype=float) * end for end in texel_ends(material.texture, name))
    return float(low.min()), float(high.max())


_known_ends: WeakKeyDictionary[Texture, dict[str, tuple[np.ndarray, np.ndarray]]] = WeakKeyDictionary()


def texel_ends(texture: Texture | None, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest texel of a map in [0, 1], by channel if it has any: () or (C,) float64. 1 where there is no
    such map; what is not a number counts as 1. Found once for as long as the texture is kept."""
    texels = None if texture is None else getattr(texture, name)
    if texture is None or texels is None:
        return np.ones(()), np.ones(())
    known = _known_ends.setdefault(texture, {})
    if name not in known:
        known[name] = _ends(texels)
    return known[name]


def _ends(texels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # Along rows that are one piece of memory, which is fifty times as fast as over two axes at once
    rows = texels.reshape(len(texels), -1)
    rows = rows.astype(np.float32) if rows.dtype == np.float16 else rows
    low, high = (end(end(rows, axis=0).reshape(texels.shape[1:]), axis=0) for end in (np.min, np.max))
    if np.isnan(low).any():
        texels = np.nan_to_num(texels, nan=1.0)
        low, high = texels.min(axis=(0, 1)), texels.max(axis=(0, 1))
    return np.clip(low, 0, 1).astype(float), np.clip(high, 0, 1).astype(float)


def coverage_range(material: Material, vertices: tuple[float, float] = (1.0, 1.0)) -> tuple[float, float]:
    """Least and largest share of a surface that is there, over its texels. vertices: least and largest alpha of the
    vertices of its faces."""
    found = tuple(alpha * other for alpha, other in zip(range_of(material, "alpha"), vertices, strict=True))
    if material.alpha_cutoff is None:
        low, high = found
    else:
        low, high = (float(alpha >= cutoff_in_half(material.alpha_cutoff)) for alpha in found)
    return low, high


def cutoff_in_half(cutoff: float) -> float:
    """What stands in for a cutoff of alpha: texels are rounded to half precision, and those that mean the cutoff shall
    not fall below it."""
    return cutoff * (1 - HALF_STEP)


def vertex_alphas(material: np.ndarray, colors: np.ndarray | None) -> dict[int, tuple[float, float]]:
    """By material, of those that a coloured face has, the least and largest alpha of these faces' vertices.

    material: (F,) by face. colors: (F, 3, 4) of their corners; a face is coloured unless all of them are 1.
    """
    if colors is None:
        return {}
    coloured = (colors != 1).any(axis=(1, 2))
    alphas = colors[..., 3]
    return {int(index): (float(found.min()), float(found.max())) for index in np.unique(material[coloured])
            if (found := alphas[material == index]).size}


def sends(material: Material) -> bool:
    """Whether a surface sends out light of its own."""
    return range_of(material, "emission")[1] > 0


def is_mapped(material: Material) -> bool:
    """Whether a texture has more than the usual maps, ends somewhere, or shows its texels as squares."""
    texture = material.texture
    return texture is not None and (texture.nearest or texture.wrap != ("repeat", "repeat") or any(
        getattr(texture, name) is not None for name in MORE_MAPS))


def is_solid(material: Material) -> bool:
    """Whether a surface bounds glass that bends light."""
    return _transmits(material) and not material.thin


def is_pane(material: Material) -> bool:
    """Whether a surface is a sheet of glass, which bends none."""
    return _transmits(material) and material.thin


def see_through(asset: Asset) -> np.ndarray:
    """(F,) which faces let light through, if only at some texel of their material: glass, and what is there in part."""
    clear, colors = np.zeros(len(asset.mesh.faces), bool), asset.mesh.colors
    for index in np.unique(asset.mesh.material).tolist():
        material, own = asset.materials[index], asset.mesh.material == index
        alphas = 1.0 if colors is None else colors[own, :, 3].min(axis=1)
        there = 1.0 if material.alpha_cutoff is None else cutoff_in_half(material.alpha_cutoff)
        clear[own] = _transmits(material) | (range_of(material, "alpha")[0] * alphas < there)
    return clear


def disperses(material: Material) -> bool:
    """Whether a surface bounds glass that bends the colours differently."""
    return is_solid(material) and material.abbe > 0


def ripples(material: Material) -> bool:
    """Whether a normal map tilts what lets light through."""
    return _transmits(material) and material.texture is not None and material.texture.normal is not None


def _transmits(material: Material) -> bool:
    """Metal lets nothing through. glTF's metallic factor is 1 unless a file says otherwise, so that with a metallic map
    the texels alone tell."""
    return range_of(material, "transmission")[1] > 0 and range_of(material, "metallic")[0] < 1
