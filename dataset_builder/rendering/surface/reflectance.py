"""Directional reflectance of lobes: the table of GGX, made once, and how tables are read on the device.

With Schlick's Fresnel term F = F0 + (F90 - F0) (1 - c)^5 the reflectance is linear in F0 and F90,
E(mu, alpha) = F0 * A(mu, alpha) + F90 * B(mu, alpha), the split sum of Karis, "Real shading in Unreal Engine 4"
(SIGGRAPH 2013 course notes). The table is that of single scattering, so A + B <= 1; `scattered_again` is what goes on
between microfacets.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

COSINES = 64
ROUGHNESSES = 64
RADII, ANGLES = 48, 24
"""Quadrature points over the disc of visible normals."""

MIN_ALPHA = 1e-3
"""Smallest GGX alpha: below it, single precision cannot resolve the lobe."""


def alpha_of(roughness: np.ndarray) -> np.ndarray:
    """GGX alpha of a perceptual roughness in [0, 1] (glTF 2.0, appendix B.2.3: alpha = roughness squared)."""
    return np.maximum(roughness**2, MIN_ALPHA)


def cosines() -> np.ndarray:
    """(COSINES,) where tables are known: (j / (COSINES - 1))^2, crowded at the horizon, where reflectance bends."""
    return np.maximum(np.linspace(0, 1, COSINES) ** 2, 1e-4)


@cache
def split_sum_table() -> np.ndarray:
    """(ROUGHNESSES, COSINES, 2) float32: A and B at roughness i / (ROUGHNESSES - 1) and cosine `cosines()[j]`."""
    mu = cosines()
    alpha = alpha_of(np.linspace(0, 1, ROUGHNESSES))
    table = np.stack([np.stack(_split_sum(mu, a), axis=-1) for a in alpha])
    table.flags.writeable = False
    return table


def _split_sum(mu: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """A and B, each (M,), for one alpha, by midpoint quadrature over visible normals.

    The rim of the disc is GGX's long tail, down to a share of alpha squared, so the points crowd there: u = 1 - (1 -
    t)^4.
    """
    t, v = ((np.arange(count) + 0.5) / count for count in (RADII, ANGLES))
    u, share = 1 - (1 - t) ** 4, 4 * (1 - t) ** 3 / RADII / ANGLES
    u, share, v = np.repeat(u, ANGLES), np.repeat(share, ANGLES), np.tile(v, RADII)
    wi = np.stack([np.sqrt(1 - mu**2), np.zeros_like(mu), mu], axis=-1)[:, None]
    normal = _visible_normals(wi, alpha, u, v)
    cosine = np.sum(wi * normal, axis=-1)
    wo_z = 2 * cosine * normal[..., 2] - wi[..., 2]
    weight = np.where(wo_z > 0, _g1(np.maximum(wo_z, 1e-7), alpha), 0)
    schlick = np.clip(1 - cosine, 0, 1) ** 5
    weight = weight * share / share.sum()
    return tuple(np.sum(weight * part, axis=1).astype(np.float32) for part in (1 - schlick, schlick))  # type: ignore[return-value]


def _visible_normals(wi: np.ndarray, alpha: float, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Microfacet normals seen from wi, by Heitz, "Sampling the GGX distribution of visible normals" (JCGT 2018)."""
    stretched = wi * np.array([alpha, alpha, 1.0])
    stretched /= np.linalg.norm(stretched, axis=-1, keepdims=True)
    side = np.array([0.0, 1.0, 0.0])
    other = np.cross(stretched, side)
    other /= np.linalg.norm(other, axis=-1, keepdims=True)
    radius, phi = np.sqrt(u), 2 * np.pi * v
    x, y = radius * np.cos(phi), radius * np.sin(phi)
    s = 0.5 * (1 + stretched[..., 2])
    y = (1 - s) * np.sqrt(1 - x**2) + s * y
    z = np.sqrt(np.maximum(0, 1 - x**2 - y**2))
    normal = x[..., None] * side + y[..., None] * other + z[..., None] * stretched
    normal = normal * np.array([alpha, alpha, 1.0])
    normal[..., 2] = np.maximum(normal[..., 2], 1e-9)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _g1(cosine: np.ndarray, alpha: float) -> np.ndarray:
    """Smith's shadowing of one direction; with separable shadowing, as in Mitsuba, also G2 / G1 of the other."""
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - cosine**2) / cosine**2))


def scattered_again(f0: mi.Color3f, once: mi.Float) -> mi.Color3f:
    """Factor by which light between microfacets raises a lobe that reflects E = `once` of the light where F0 is 1:
    1 + F0 (1 - E) / E (Turquin, "Practical multiple scattering compensation for microfacet models", 2019).
    A white lobe then reflects all."""
    return 1 + f0 * ((1 - once) * dr.rcp(dr.maximum(once, 1e-3)))


def interpolated(kind: Any, table: mi.Float, cosine: mi.Float, roughness: mi.Float, active: mi.Bool) -> Any:
    """Bilinear value, a `kind` (mi.Float or mi.Vector2f), of a flat (ROUGHNESSES, COSINES, ...) table."""
    x = dr.sqrt(dr.clip(cosine, 0, 1)) * (COSINES - 1)
    y = dr.clip(roughness, 0, 1) * (ROUGHNESSES - 1)
    column = dr.minimum(mi.UInt32(x), COSINES - 2)
    line = dr.minimum(mi.UInt32(y), ROUGHNESSES - 2)
    fx, fy = x - mi.Float(column), y - mi.Float(line)
    first = line * COSINES + column
    corners = [dr.gather(kind, table, first + step, active) for step in (0, 1, COSINES, COSINES + 1)]
    return dr.lerp(dr.lerp(corners[0], corners[1], fx), dr.lerp(corners[2], corners[3], fx), fy)
