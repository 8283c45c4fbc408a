"""All lobes of a surface at one point: evaluated together, and sampled in proportion to what they reflect or pass.

The base reflects f cos = D cos / pi + F D_ggx G / (4 cos_i) + sheen, with visible normals sampled as Heitz (JCGT 2018)
does; a coat is one more GGX lobe above it, and glass takes the place of a share of it. A lobe that is None is not
compiled. `layering` finds D, R and what each lobe weighs.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface import glass as glass_lobes
from dataset_builder.rendering.surface import gloss
from dataset_builder.rendering.surface import sheen as sheen_lobe
from dataset_builder.rendering.surface.glass import Glass
from dataset_builder.rendering.surface.gloss import GgxLobe
from dataset_builder.rendering.surface.sheen import Sheen

DIFFUSE, GLOSSY, GLOSSY_TRANSMISSION, DELTA_REFLECTION, DELTA_TRANSMISSION, NULL = range(6)
"""Components, in the order in which a surface that has them lists them."""
AIR = GLOSSY + 1
"""What passes straight on where there is no glass."""


@dataclass
class Lobes:
    """All lobes at a point, each with the weight that the layers above leave it."""

    diffuse: mi.Color3f
    """D, the diffuse reflectance."""
    normal: mi.Normal3f
    """Local shading normal, turned to the viewer."""
    glossy: GgxLobe | None = None
    coat: GgxLobe | None = None
    """It lies on the surface itself, whatever a normal map tilts below it."""
    sheen: Sheen | None = None
    glass: Glass | None = None
    coverage: mi.Float | None = None
    """Share of the surface that is there, where that is still open; `evaluate` and `sample` count the rest as air."""

    @property
    def top(self) -> bool:
        """Whether there is more than the base to choose from."""
        return self.coat is not None or self.glass is not None


@dataclass
class Scattered:
    """A direction that was drawn."""

    wo: mi.Vector3f
    valid: mi.Bool
    """Whether it is on the side that its lobe sends light to: elsewhere it would be taken for another lobe's."""
    component: mi.UInt32
    kind: mi.UInt32
    """Mitsuba's flag of the lobe."""
    eta: mi.Float
    """Relative index along it."""
    delta: mi.Bool
    null: mi.Bool
    """Whether it goes straight on."""
    delta_weight: mi.Color3f
    """f cos / p of a discrete choice."""
    delta_probability: mi.Float
    """Of a discrete choice."""


def reflectance(lobes: Lobes, si: mi.SurfaceInteraction3f) -> mi.Color3f:
    """R: directional reflectance of everything but the diffuse lobe."""
    parts = [part.reflectance for part in (lobes.glossy, lobes.coat, lobes.sheen) if part is not None]
    if lobes.glass is not None:
        wi = mi.Frame3f(lobes.normal).to_local(si.wi)
        parts.append(lobes.glass.weight * glass_lobes.reflectance(lobes.glass, wi))
    return sum(parts, mi.Color3f(0))


def transparency(lobes: Lobes, si: mi.SurfaceInteraction3f) -> mi.Color3f:
    """Share of light that passes straight on, as if the surface were not there."""
    passed = mi.Color3f(0)
    if lobes.glass is not None:
        passed = glass_lobes.straight(lobes.glass, mi.Frame3f(lobes.normal).to_local(si.wi))
    return passed if lobes.coverage is None else 1 - lobes.coverage + lobes.coverage * passed


def evaluate(lobes: Lobes, si: mi.SurfaceInteraction3f, wo: mi.Vector3f) -> tuple[mi.Color3f, mi.Float]:
    """f cos and its sampling density, of all lobes but the discrete ones."""
    sh_frame = mi.Frame3f(lobes.normal)
    wi, wo_facing = sh_frame.to_local(si.wi), sh_frame.to_local(wo)
    cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo_facing)
    above = _above(si, wo)
    valid = (cos_i > 0) & (cos_o > 0) & above
    half = dr.normalize(wi + wo_facing)
    value, pdf = lobes.diffuse * (cos_o * dr.inv_pi), cos_o * dr.inv_pi
    if lobes.glossy is not None:
        glossy, glossy_pdf = gloss.evaluate(lobes.glossy, wi, wo_facing, half)
        value, pdf = value + glossy, dr.lerp(pdf, glossy_pdf, _glossy_share(lobes, lobes.glossy))
    if lobes.sheen is not None:
        value += sheen_lobe.evaluate(lobes.sheen, wi, wo_facing, half)
    value, pdf = dr.select(valid, value, 0), dr.select(valid, pdf, 0)
    if lobes.top:
        value, pdf = _add_top(lobes, si, wo, above, value, pdf)
    return (value, pdf) if lobes.coverage is None else (value * lobes.coverage, pdf * lobes.coverage)


def scatter(lobes: Lobes, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f) -> Scattered:
    """A local direction of one of the lobes, picked in proportion to their reflectance. What is left of the chance
    in `sample1` replaces sample2.x, except in glass: a stratified pair (sample1, sample2.y) stratifies each lobe."""
    sh_frame = mi.Frame3f(lobes.normal)
    wi = sh_frame.to_local(si.wi)
    coat_share, glass_share = _top_shares(lobes)
    top = coat_share + glass_share
    base_sample = (sample1 - top) / (1 - top) if lobes.top else sample1
    share = mi.Float(0) if lobes.glossy is None else _glossy_share(lobes, lobes.glossy)
    take_glossy = base_sample < share
    left = dr.select(take_glossy, base_sample / share, (base_sample - share) / (1 - share))
    within = mi.Point2f(_unit(left), sample2.y)
    wo = mi.warp.square_to_cosine_hemisphere(within)
    if lobes.glossy is not None:
        normal, _ = gloss.facets(lobes.glossy).sample(wi, within)
        wo = dr.select(take_glossy, mi.reflect(wi, normal), wo)
    found = Scattered(wo=sh_frame.to_world(wo), valid=mi.Bool(True),
                      component=dr.select(take_glossy, mi.UInt32(GLOSSY), mi.UInt32(DIFFUSE)),
                      kind=dr.select(take_glossy, mi.UInt32(+mi.BSDFFlags.GlossyReflection),
                                     mi.UInt32(+mi.BSDFFlags.DiffuseReflection)),
                      eta=mi.Float(1), delta=mi.Bool(False), null=mi.Bool(False), delta_weight=mi.Color3f(0),
                      delta_probability=mi.Float(0))
    if lobes.top:
        found.valid = _above(si, found.wo) & (mi.Frame3f.cos_theta(wo) > 0)
    if lobes.coat is not None:
        _scatter_coat(found, lobes.coat, si, mi.Point2f(_unit(sample1 / coat_share), sample2.y), sample1 < coat_share)
    if lobes.glass is not None:
        crossing = glass_lobes.scatter(lobes.glass, wi, (sample1 - coat_share) / glass_share, sample2)
        taken = (sample1 >= coat_share) & (sample1 < top)
        _scatter_glass(found, lobes.glass, crossing, sh_frame, si, glass_share, taken)
    return found


def _unit(sample: mi.Float) -> mi.Float:
    """Clipped to [0, 1), where rounding or another lobe's pick left it."""
    return dr.clip(sample, 0, dr.one_minus_epsilon(mi.Float))


def sample(lobes: Lobes, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
           active: mi.Bool) -> tuple[mi.BSDFSample3f, mi.Color3f]:
    """A local direction of one of the lobes, or straight on past what is not there, and its weight."""
    past = mi.Bool(False)
    if lobes.coverage is not None:
        past = sample1 >= lobes.coverage
        sample1 = dr.select(past, sample1, sample1 / lobes.coverage)
    found = scatter(lobes, si, sample1, sample2)
    bs = dr.zeros(mi.BSDFSample3f)
    bs.wo, bs.eta, bs.sampled_component, bs.sampled_type = found.wo, found.eta, found.component, found.kind
    value, pdf = evaluate(lobes, si, bs.wo)
    asked, active = active, active & found.valid & (pdf > 0)
    weight = dr.select(active, value / pdf, 0)
    bs.pdf = dr.select(active, pdf, 0)
    if lobes.glass is not None:
        share = 1 if lobes.coverage is None else lobes.coverage
        bs.pdf = dr.select(found.delta, found.delta_probability * share, bs.pdf)
        weight = dr.select(found.delta, found.delta_weight, weight)
    if lobes.coverage is not None:
        bs.wo, bs.eta = dr.select(past, -si.wi, bs.wo), dr.select(past, 1, bs.eta)
        bs.sampled_component = dr.select(past, mi.UInt32(NULL if lobes.glass is not None else AIR),
                                         bs.sampled_component)
        bs.sampled_type = dr.select(past, mi.UInt32(+mi.BSDFFlags.Null), bs.sampled_type)
        bs.pdf = dr.select(past, 1 - lobes.coverage, bs.pdf)
        weight = dr.select(past & asked, mi.Color3f(1), weight)
    return bs, weight


def _add_top(lobes: Lobes, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, above: mi.Bool, value: mi.Color3f,
             pdf: mi.Float) -> tuple[mi.Color3f, mi.Float]:
    """The base's value and density with those of coat and glass."""
    coat_share, glass_share = _top_shares(lobes)
    pdf = pdf * (1 - coat_share - glass_share)
    if lobes.coat is not None:
        wi_up, wo_up = upright(si, si.wi), upright(si, wo)
        coat, coat_pdf = gloss.evaluate(lobes.coat, wi_up, wo_up, dr.normalize(wi_up + wo_up))
        value += dr.select(above, coat, 0)
        pdf += dr.select(above, coat_share * coat_pdf, 0)
    if lobes.glass is not None:
        sh_frame = mi.Frame3f(lobes.normal)
        through, glass_pdf = glass_lobes.evaluate(lobes.glass, sh_frame.to_local(si.wi), sh_frame.to_local(wo), above)
        value, pdf = value + through, pdf + glass_share * glass_pdf
    return value, pdf


def _scatter_coat(found: Scattered, coat: GgxLobe, si: mi.SurfaceInteraction3f, sample2: mi.Point2f,
                  taken: mi.Bool) -> None:
    wi = upright(si, si.wi)
    normal, _ = gloss.facets(coat).sample(wi, sample2)
    mirrored = mi.reflect(wi, normal)
    found.wo = dr.select(taken, upright(si, mirrored), found.wo)
    found.valid = dr.select(taken, mi.Frame3f.cos_theta(mirrored) > 0, found.valid)
    found.component = dr.select(taken, mi.UInt32(GLOSSY), found.component)
    found.kind = dr.select(taken, mi.UInt32(+mi.BSDFFlags.GlossyReflection), found.kind)


def _scatter_glass(found: Scattered, glass: Glass, crossing: glass_lobes.Crossing, sh_frame: mi.Frame3f,
                   si: mi.SurfaceInteraction3f, share: mi.Float, taken: mi.Bool) -> None:
    flags, null = mi.BSDFFlags, crossing.null
    wo = dr.select(null, -si.wi, sh_frame.to_world(crossing.wo))
    kept = (_above(si, wo) == crossing.reflected) & ((mi.Frame3f.cos_theta(crossing.wo) > 0) == crossing.reflected)
    found.valid = dr.select(taken, kept, found.valid)
    found.wo, found.eta = dr.select(taken, wo, found.wo), dr.select(taken, crossing.eta, found.eta)
    found.delta, found.null = taken & glass.smooth, taken & null
    found.delta_weight = dr.select(found.delta & kept, crossing.weight * glass.weight / share, 0)
    found.delta_probability = dr.select(found.delta & kept, crossing.probability * share, 0)
    choices = ((glass.smooth & crossing.reflected, DELTA_REFLECTION, flags.DeltaReflection),
               (null, NULL, flags.Null), (glass.smooth & ~null & ~crossing.reflected, DELTA_TRANSMISSION,
                                          flags.DeltaTransmission),
               (~glass.smooth & crossing.reflected, GLOSSY, flags.GlossyReflection),
               (~glass.smooth & ~crossing.reflected, GLOSSY_TRANSMISSION, flags.GlossyTransmission))
    for chosen, component, flag in choices:
        found.component = dr.select(taken & chosen, mi.UInt32(component), found.component)
        found.kind = dr.select(taken & chosen, mi.UInt32(+flag), found.kind)


def _glossy_share(lobes: Lobes, lobe: GgxLobe) -> mi.Float:
    """Probability of the GGX lobe within the base; both lobes keep a share wherever they send light."""
    diffuse, specular = _diffuse_albedo(lobes), dr.mean(lobe.reflectance)
    return dr.select(diffuse + specular > 0, specular / (diffuse + specular), 0)


def _top_shares(lobes: Lobes) -> tuple[mi.Float, mi.Float]:
    """Probabilities of the coat and of glass; the base has the rest."""
    coat = mi.Float(0) if lobes.coat is None else dr.mean(lobes.coat.reflectance)
    glass = mi.Float(0) if lobes.glass is None else lobes.glass.weight
    base = _diffuse_albedo(lobes) + (mi.Float(0) if lobes.glossy is None else dr.mean(lobes.glossy.reflectance))
    total = base + coat + glass
    return dr.select(total > 0, coat / total, 0), dr.select(total > 0, glass / total, 0)


def _diffuse_albedo(lobes: Lobes) -> mi.Float:
    """What the cosine lobe samples."""
    diffuse = dr.mean(lobes.diffuse)
    return diffuse if lobes.sheen is None else diffuse + dr.mean(lobes.sheen.reflectance)


def _above(si: mi.SurfaceInteraction3f, wo: mi.Vector3f) -> mi.Bool:
    """Whether a local direction is on the viewer's side of the untilted surface."""
    return mi.Frame3f.cos_theta(si.wi) * mi.Frame3f.cos_theta(wo) > 0


def upright(si: mi.SurfaceInteraction3f, direction: mi.Vector3f) -> mi.Vector3f:
    """A local direction as seen from the viewer's side of the untilted surface, and back."""
    return mi.Vector3f(direction.x, direction.y, dr.mulsign(direction.z, mi.Frame3f.cos_theta(si.wi)))
