"""Bounds on how much light a material scatters, from its numbers and texels alone."""

import numpy as np

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.glass_kinds import metallic_range

SCHLICK_MEAN = 1 / 21
"""Integral of 2 c (1 - c)^5 over cosines c: mean of Schlick's term for light from everywhere."""
COAT_F0 = 0.04
STEPS = 256


def mean_schlick(f0: np.ndarray) -> np.ndarray:
    """(..., 3) reflectance of a specular lobe for light from everywhere; roughness only lowers it.

    Schlick's term with the F90 of `rendering.surface`, averaged over the hemisphere.
    """
    f90 = np.minimum(50 * f0.max(axis=-1, keepdims=True), 1)
    return f0 + (f90 - f0) * SCHLICK_MEAN


def glass_share(ior: float, thin: bool) -> float:
    """Share of light from everywhere outside that glass reflects: Fresnel's F, or 2 F / (1 + F) for the two faces of a
    pane, by midpoints over the squared cosine."""
    cosine = np.sqrt((np.arange(STEPS) + 0.5) / STEPS)
    inside = np.sqrt(1 - (1 - cosine**2) / ior**2)
    across = (cosine - ior * inside) / (cosine + ior * inside)
    along = (ior * cosine - inside) / (ior * cosine + inside)
    face = (across**2 + along**2) / 2
    return float(np.mean(2 * face / (1 + face) if thin else face))


def scattered_share(material: Material) -> float:
    """Largest share of light from everywhere that a material scatters, over channels, texels and its lobes.

    In [0, 1]. What goes into glass or back inside it is not in it: that goes on as it came and counts as crossings.
    """
    base, (low, high) = np.asarray(material.base_color) * _brightest(material.texture), metallic_range(material)
    # What is opaque scatters most at one of them: 1 - that is a product of two lines
    opaque = np.maximum(_opaque(material, base, low), _opaque(material, base, high))
    glass = glass_share(material.ior, material.thin) if material.transmission else 0.0
    share = np.maximum(opaque + material.transmission * (1 - high) * np.minimum(glass - opaque, 0), glass)
    return float(np.clip(_layered(material, share).max(), 0, 1))


def _brightest(texture: Texture | None) -> np.ndarray:
    """(3,) largest texel of each channel; what is not a number counts as white."""
    if texture is None:
        return np.ones(3)
    return np.clip(np.nan_to_num(texture.base_color, nan=1.0), 0, 1).max(axis=(0, 1))


def _opaque(material: Material, base: np.ndarray, metallic: float) -> np.ndarray:
    """(3,) diffuse base under its specular lobe, which passes on what it does not reflect."""
    specular = mean_schlick((1 - metallic) * material.specular + metallic * base)
    return specular + base * (1 - metallic) * (1 - specular)


def _layered(material: Material, share: np.ndarray) -> np.ndarray:
    """(3,) share under sheen, under a coat; each passes on what it does not reflect, and sheen reflects at most all."""
    sheen = np.asarray(material.sheen)
    share = np.maximum(share, sheen + share * (1 - sheen.max()))
    coat = material.coat * mean_schlick(np.full(1, COAT_F0))
    return coat + (1 - coat) * share
