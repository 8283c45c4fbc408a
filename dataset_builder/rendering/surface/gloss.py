"""A GGX lobe: the gloss of dielectrics, metal, and coats."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass
class GgxLobe:
    """A GGX lobe with Schlick's F0 and F90."""

    reflectance: mi.Color3f
    """Directional, seen from the viewer."""
    f0: mi.Color3f
    f90: mi.Color3f
    alpha: mi.Float


def evaluate(lobe: GgxLobe, wi: mi.Vector3f, wo: mi.Vector3f, half: mi.Normal3f) -> tuple[mi.Color3f, mi.Float]:
    """f cos and density of a GGX lobe, directions in its frame.

    f = F G D / (4 cos_i cos_o) and p = p(half) / (4 cos_half) (Walter et al., "Microfacet models for refraction through
    rough surfaces", EGSR 2007, equations 20 and 14), F = F0 + (F90 - F0) (1 - cos_half)^5 (Schlick, "An inexpensive
    BRDF model for physically-based rendering", Computer Graphics Forum 13(3), 1994).
    """
    ggx = facets(lobe)
    fresnel = lobe.f0 + (lobe.f90 - lobe.f0) * (dr.maximum(1 - dr.dot(wi, half), 0) ** 5)
    value = fresnel * ggx.eval(half) * ggx.G(wi, wo, half) / (4 * mi.Frame3f.cos_theta(wi))
    return value, ggx.pdf(wi, half) / (4 * dr.dot(wo, half))


def facets(lobe: GgxLobe) -> mi.MicrofacetDistribution:
    """Its facets, of which those that the viewer sees are sampled."""
    return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, lobe.alpha, sample_visible=True)
