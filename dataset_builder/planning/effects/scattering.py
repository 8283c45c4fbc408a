"""How surfaces scatter paths that planning traces: the lobes of `rendering.surface`, one chosen at a time.

Energies follow the same formulas (Schlick's term, Fresnel's for glass, coats over all else), and directions nearly: a
microfacet is drawn from GGX's normals (Walter et al. 2007, equation 35), without its masking, which would only take
light away. Paths therefore lose at most as much as they do in rendering, but for what facets hide.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from dataset_builder.planning.effects.walk_surfaces import Met

WIDE = 0.3
"""Roughness above which a lobe finds lamps by points drawn on them."""
COAT_F0 = 0.04


@dataclass(frozen=True, kw_only=True, eq=False)
class Rebound:
    """What becomes of N paths on a surface."""

    direction: np.ndarray
    """(N, 3) unit vectors along which they go on."""
    weight: np.ndarray
    """(N, 3) what is left of their weight, by channel."""
    straight: np.ndarray
    """(N,) whether they pass as if nothing were there."""
    wide: np.ndarray
    """(N,) whether the lobe is wide."""


def about(normals: np.ndarray, draws: np.random.Generator) -> np.ndarray:
    """(N, 3) unit vectors, cosine-distributed about normals (N, 3)."""
    return _unit(normals + 0.999 * _unit(draws.normal(size=normals.shape)))


def around(axes: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """(N, 3) unit vectors square to axes (N, 3), turned about them by angles (N,)."""
    aside = np.where(np.abs(axes[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    right = _unit(_cross(aside, axes))
    found: np.ndarray = np.cos(turns)[:, None] * right + np.sin(turns)[:, None] * _cross(axes, right)
    return found


def _unit(vectors: np.ndarray) -> np.ndarray:
    """(N, 3) vectors brought to length 1. NumPy's own functions for this and for `_cross` take three times as long
    where paths are few, as in most steps."""
    x, y, z = (vectors * vectors).T
    unit: np.ndarray = vectors / np.sqrt(x + y + z)[:, None]
    return unit


def _cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    (a, b, c), (x, y, z) = one.T, other.T
    return np.column_stack([b * z - c * y, c * x - a * z, a * y - b * x])


def scatter(met: Met, ahead: np.ndarray, draws: np.random.Generator) -> Rebound:
    """What paths along unit vectors (N, 3) do on the surfaces that they met."""
    of, count = met.factors, len(ahead)
    chance = draws.random((count, 5))
    inside = np.einsum("ij,ij->i", met.normal, ahead) > 0
    normal = np.where(inside[:, None], -met.normal, met.normal)
    rough = np.clip(of["roughness"], 0, 1)
    facet = _facets(normal, ahead, rough, chance[:, 3:])
    cosine = np.clip(-np.einsum("ij,ij->i", facet, ahead), 0, 1)
    grazing = (1 - cosine) ** 5
    mirrored = ahead + 2 * cosine[:, None] * facet

    # From the top: gaps, coat, metal, glass or specular lobe, base
    straight = chance[:, 0] > of["coverage"]
    coat = of["coat"] * (COAT_F0 + (1 - COAT_F0) * grazing)
    coated = ~straight & (chance[:, 1] < coat)
    metal = ~straight & ~coated & (chance[:, 2] < of["metallic"])
    rest = ~straight & ~coated & ~metal
    glass = rest & (_share(chance[:, 2], of["metallic"]) < of["transmission"])
    eta = np.where(inside & ~of["thin"].astype(bool), 1 / of["ior"], of["ior"])
    face, bent = _fresnel(cosine, eta)
    thin = of["thin"].astype(bool)
    face = np.where(thin, 2 * face / (1 + face), face)
    f0 = of["specular"]
    f90 = np.minimum(50 * f0, 1)
    lobe = np.where(glass, face, f0 + (f90 - f0) * grazing)
    again = draws.random(count)
    mirror = coated | metal | (rest & (again < lobe))
    crossing, base = glass & ~mirror, rest & ~glass & ~mirror

    refracted = ahead / eta[:, None] + (cosine / eta - bent)[:, None] * facet
    passing = np.where(thin[:, None], ahead, _unit(refracted))
    out = np.where(mirror[:, None], mirrored, np.where(crossing[:, None], passing, ahead))
    out[base] = about(normal[base], draws)
    # A facet that sends light into the surface: it goes out by the mirror image
    across = np.einsum("ij,ij->i", out, normal)
    wrong = (mirror & (across < 0)) | (crossing & (across > 0))
    out = np.where(wrong[:, None], out - 2 * across[:, None] * normal, out)

    color, weight = of["base_color"], np.ones((count, 3))
    weight[metal] = (color + (1 - color) * grazing[:, None])[metal]
    sheen = of["sheen"][base]
    weight[base] = np.minimum(sheen + color[base] * (1 - sheen.max(axis=1, keepdims=True)), 1)
    weight[crossing] = np.where(thin[:, None], color, np.sqrt(color))[crossing]
    return Rebound(direction=out, weight=weight, straight=straight | (crossing & thin & (rough <= 0.04)),
                     wide=base | (mirror & ~glass & ~coated & (rough > WIDE)))


def _share(number: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """What is left of uniform numbers (N,) of which the lowest `taken` went elsewhere: uniform again."""
    return np.clip((number - taken) / np.maximum(1 - taken, 1e-9), 0, 1)


def _fresnel(cosine: np.ndarray, eta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) reflectance of a dielectric at cosines and relative indices (N,), and (N,) cosines of what is refracted; 1
    and 0 where all is reflected."""
    squared = 1 - (1 - cosine**2) / eta**2
    bent = np.sqrt(np.maximum(squared, 0))
    across = (cosine - eta * bent) / np.maximum(cosine + eta * bent, 1e-9)
    along = (eta * cosine - bent) / np.maximum(eta * cosine + bent, 1e-9)
    return np.where(squared > 0, (across**2 + along**2) / 2, 1.0), bent


def _facets(normal: np.ndarray, ahead: np.ndarray, rough: np.ndarray, chance: np.ndarray) -> np.ndarray:
    """(N, 3) unit normals of facets that paths along `ahead` see, about `normal`."""
    uneven = np.flatnonzero(rough)
    number, found = chance[uneven], normal.copy()
    tangent = rough[uneven] ** 2 * np.sqrt(number[:, 0] / np.maximum(1 - number[:, 0], 1e-9))
    found[uneven] += tangent[:, None] * around(normal[uneven], 2 * pi * number[:, 1])
    found = _unit(found)
    seen = np.einsum("ij,ij->i", found, ahead) < 0
    return np.where(seen[:, None], found, normal)
