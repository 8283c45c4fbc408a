"""The two lobes of a surface at one point: evaluated together, and sampled in proportion to what they reflect.

f cos = D cos / pi + F D_ggx G / (4 cos_i), with visible normals sampled as Heitz (JCGT 2018) does; `surface` finds D
and R.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass
class Lobes:
    """Both lobes at a point: D, R, Schlick's F0 and F90, GGX alpha, and the local shading normal turned to the
    viewer."""

    diffuse: mi.Color3f
    specular: mi.Color3f
    f0: mi.Color3f
    f90: mi.Float
    alpha: mi.Float
    normal: mi.Normal3f


def _ggx(lobes: Lobes) -> mi.MicrofacetDistribution:
    return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, lobes.alpha, sample_visible=True)


def _glossy_share(lobes: Lobes) -> mi.Float:
    """Probability of sampling the GGX lobe; both lobes keep a share wherever they send light."""
    diffuse, specular = dr.mean(lobes.diffuse), dr.mean(lobes.specular)
    return dr.select(diffuse + specular > 0, specular / (diffuse + specular), 0)


def evaluate(lobes: Lobes, si: mi.SurfaceInteraction3f, wo: mi.Vector3f) -> tuple[mi.Color3f, mi.Float]:
    """f cos and its sampling density; zero where wo is not on the viewer's side."""
    frame = mi.Frame3f(lobes.normal)
    wi, wo_facing = frame.to_local(si.wi), frame.to_local(wo)
    cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo_facing)
    above = mi.Frame3f.cos_theta(si.wi) * mi.Frame3f.cos_theta(wo) > 0
    valid = (cos_i > 0) & (cos_o > 0) & above
    half = dr.normalize(wi + wo_facing)
    ggx = _ggx(lobes)
    schlick = lobes.f0 + (lobes.f90 - lobes.f0) * (dr.maximum(1 - dr.dot(wi, half), 0) ** 5)
    mirror = schlick * ggx.eval(half) * ggx.G(wi, wo_facing, half) / (4 * cos_i)
    glossy = _glossy_share(lobes)
    density = dr.lerp(cos_o * dr.inv_pi, ggx.pdf(wi, half) / (4 * dr.dot(wo_facing, half)), glossy)
    value = lobes.diffuse * (cos_o * dr.inv_pi) + mirror
    return dr.select(valid, value, 0), dr.select(valid, density, 0)


def sample(lobes: Lobes, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
            active: mi.Bool) -> tuple[mi.BSDFSample3f, mi.Color3f]:
    """A local direction of the diffuse or the GGX lobe, picked in proportion to their reflectance, and its weight."""
    frame = mi.Frame3f(lobes.normal)
    wi = frame.to_local(si.wi)
    take_glossy = sample1 < _glossy_share(lobes)
    facet, _ = _ggx(lobes).sample(wi, sample2)
    wo = dr.select(take_glossy, mi.reflect(wi, facet), mi.warp.square_to_cosine_hemisphere(sample2))
    bs = dr.zeros(mi.BSDFSample3f)
    bs.wo = frame.to_world(wo)
    value, density = evaluate(lobes, si, bs.wo)
    active = active & (density > 0)
    bs.pdf, bs.eta = dr.select(active, density, 0), 1
    bs.sampled_component = dr.select(take_glossy, mi.UInt32(1), mi.UInt32(0))
    bs.sampled_type = dr.select(take_glossy, mi.UInt32(+mi.BSDFFlags.GlossyReflection),
                                mi.UInt32(+mi.BSDFFlags.DiffuseReflection))
    return bs, dr.select(active, value / density, 0)
