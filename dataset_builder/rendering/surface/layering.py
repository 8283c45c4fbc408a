"""From a material at a point to its lobes: what each layer takes, and what it leaves to those below.

From the top: coat, sheen, then a mixture of metal, glass and an opaque dielectric. Each layer scales what lies below by
what its own directional reflectance, seen from the viewer's side alone, leaves over: the albedo scaling of OpenPBR, of
Cycles, and of KHR_materials_clearcoat and _sheen. The diffuse lobe is thereby Lambertian in the other direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface import sheen as sheen_lobe
from dataset_builder.rendering.surface.channels_left import unpack
from dataset_builder.rendering.surface.glass import glass_of
from dataset_builder.rendering.surface.gloss import GgxLobe
from dataset_builder.rendering.surface.lobes import Lobes
from dataset_builder.rendering.surface.material_table import SurfacePoint, is_outside
from dataset_builder.rendering.surface.nesting import left_of
from dataset_builder.rendering.surface.reflectance import MIN_ALPHA, scattered_again

COAT_F0 = 0.04
"""Of an index of refraction of 1.5."""

GRAZING = 50
"""F90 is this times the largest F0, and at most 1: a surface of no reflectance has none at the horizon either."""


@dataclass(frozen=True, kw_only=True)
class Reflectances:
    """Tables that are read on the device, at (cosine, roughness)."""

    split_sum: Callable[[mi.Float, mi.Float], mi.Vector2f]
    """A and B of a GGX lobe."""
    sheen: Callable[[mi.Float, mi.Float], mi.Float]
    """E of the Charlie lobe."""


def lobes_of(point: SurfacePoint, features: frozenset[str], si: mi.SurfaceInteraction3f,
             tables: Reflectances) -> Lobes:
    """The lobes that `features` has, weighted."""
    if point.sides is not None:
        _leave_out(point, point.sides.same)
    viewer = dr.sign(mi.Frame3f.cos_theta(si.wi))
    lobes = Lobes(diffuse=mi.Color3f(0), normal=_facing(point.normal, viewer, si.wi))
    cosine = dr.abs(dr.dot(si.wi, lobes.normal))
    below: Any = 1
    if point.coat is not None:
        upright = dr.abs(mi.Frame3f.cos_theta(si.wi))
        lobes.coat = _ggx_lobe(mi.Color3f(COAT_F0), point.coat_roughness, upright, point.coat, tables)
        below = 1 - dr.max(lobes.coat.reflectance)
    if point.sheen is not None:
        lobes.sheen, left = _sheen(point, cosine, below, tables)
        below = below * left
    opaque: Any = 1
    if point.transmission is not None:
        share = point.transmission * (1 - point.metallic)
        opaque = 1 - share
        lobes.glass = glass_of(weight=share * below, base=point.base, roughness=point.roughness, ior=point.ior,
                               abbe=point.abbe if "dispersion" in features else None, thin=_thin(point.thin, features),
                               outside=is_outside(si), sides=point.sides,
                               left=_left(si, point.sides is not None) if "dispersion" in features else mi.Color3f(1))
    _opaque(lobes, point, features, cosine, below, opaque, tables)
    return lobes


def _left(si: mi.SurfaceInteraction3f, nested: bool) -> mi.Color3f:
    """What the path to a surface has left of the channels."""
    return left_of(si.time) if nested else unpack(si.time)


def _leave_out(point: SurfacePoint, same: mi.Bool) -> None:
    """Make smooth glass of a surface that has one body on both sides: without a change of index, nothing is there."""
    point.transmission, point.metallic = dr.select(same, 1, point.transmission), dr.select(same, 0, point.metallic)
    point.normal = dr.select(same, mi.Normal3f(0, 0, 1), point.normal)
    if point.coat is not None:
        point.coat = dr.select(same, 0, point.coat)
    if point.sheen is not None:
        point.sheen = dr.select(same, 0, point.sheen)


def _opaque(lobes: Lobes, point: SurfacePoint, features: frozenset[str], cosine: mi.Float, below: Any, opaque: Any,
            tables: Reflectances) -> None:
    """Metal and opaque dielectric, which have `opaque` of the surface and `below` of the light."""
    # Interpolated texels may add up to a hair more than 1
    matte = point.base * dr.maximum(1 - point.metallic, 0)
    if point.transmission is not None:
        matte = matte * (1 - point.transmission)
    lobes.diffuse = matte * below
    if "specular" in features:
        metal = point.metallic
        if point.transmission is not None:
            metal = dr.select(opaque > 0, metal / opaque, 0)
        f0 = dr.lerp(mi.Color3f(point.specular), point.base, metal)
        lobes.glossy = _ggx_lobe(f0, point.roughness, cosine, 1, tables)
        lobes.diffuse = matte * (1 - lobes.glossy.reflectance) * below
        _scale(lobes.glossy, opaque * below)


def _ggx_lobe(f0: mi.Color3f, roughness: mi.Float, cosine: mi.Float, weight: Any, tables: Reflectances) -> GgxLobe:
    f90 = mi.Color3f(dr.minimum(dr.max(f0) * GRAZING, 1))
    split = tables.split_sum(cosine, roughness)
    lobe = GgxLobe(reflectance=f0 * split.x + f90 * split.y, f0=f0, f90=f90,
                   alpha=dr.maximum(roughness * roughness, MIN_ALPHA))
    _scale(lobe, scattered_again(f0, split.x + split.y))
    _scale(lobe, weight)
    return lobe


def _scale(lobe: GgxLobe, weight: Any) -> None:
    lobe.reflectance, lobe.f0, lobe.f90 = lobe.reflectance * weight, lobe.f0 * weight, lobe.f90 * weight


def _sheen(point: SurfacePoint, cosine: mi.Float, below: Any,
           tables: Reflectances) -> tuple[sheen_lobe.Sheen, mi.Float]:
    """The lobe, and what it leaves to what is below. Where Charlie's lobe would send back more than it gets, which it
    does at grazing angles, it is scaled down to all that it gets."""
    roughness = dr.maximum(point.sheen_roughness, sheen_lobe.MIN_ROUGHNESS)
    full = tables.sheen(cosine, roughness)
    kept, share = dr.rcp(dr.maximum(full, 1)), dr.minimum(full, 1)
    lobe = sheen_lobe.Sheen(colour=point.sheen * (below * kept), reflectance=point.sheen * (below * share),
                            exponent=sheen_lobe.exponent_of(roughness))
    return lobe, 1 - dr.max(point.sheen) * share


def _thin(thin: mi.Float, features: frozenset[str]) -> mi.Bool:
    return thin > 0 if {"glass", "thin"} <= features else mi.Bool("thin" in features)


def _facing(normal: mi.Normal3f, viewer: mi.Float, wi: mi.Vector3f) -> mi.Normal3f:
    """The normal on the viewer's side; the unperturbed one where a normal map would tilt it out of sight."""
    turned = mi.Normal3f(normal.x, normal.y, normal.z * viewer)
    return dr.select(dr.dot(turned, wi) > 1e-3, turned, mi.Normal3f(0, 0, viewer))
