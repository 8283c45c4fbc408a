"""Glass at one point: solid or a thin pane, smooth or rough, with one index of refraction or one per colour channel.

Solid glass has the exact Fresnel terms of a dielectric and, where it is rough, the lobes of Walter et al., "Microfacet
models for refraction through rough surfaces" (EGSR 2007, equations 16 to 21) with visible normals. Seen from outside
light meets the index n, from inside 1 / n. Refraction scales radiance by the square of the index ratio, which entering
and leaving cancel (Veach 1997, section 5.2). A pane stands for two parallel faces at once: with F of one face and all
reflections between both, it reflects 2 F / (1 + F) and passes (1 - F) / (1 + F) straight on, or, where it is rough,
into the mirror image of the reflected lobe (KHR_materials_transmission).

Directions here are in the frame of the shading normal on the viewer's side, so cos_i > 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.nesting import Sides
from dataset_builder.rendering.surface.reflectance import MIN_ALPHA

MIN_BEND = 0.01
"""Solid glass whose index is nearer to one than this counts as smooth: it bends light less than facets are resolved."""

ABBE_STEPS = (-0.1138, 0.2212, 0.9160)
"""(1/l^2 - 1/l_d^2) / (1/l_F^2 - 1/l_C^2) at l = 611, 549 and 464 nm: with Cauchy's formula n = A + B / l^2, how far
the index of a channel is from that of the d line, in units of the main dispersion n_F - n_C = (n_d - 1) / V."""

QUADRATURE = 128
"""Facets by which the reflectance of rough glass is found."""


@dataclass
class Glass:
    """Glass at a point."""

    weight: mi.Float
    """Share of the surface that is glass."""
    tint: mi.Color3f
    """What a crossing leaves."""
    indices: tuple[mi.Float, ...]
    """Relative index of refraction for light that goes on from the viewer's side, one or one per channel."""
    thin: mi.Bool
    smooth: mi.Bool
    alpha: mi.Float
    spreads: mi.Bool
    """Whether these differ."""
    left: mi.Color3f
    """What the path has left of each channel, see `channels_left.unpack`: it follows each with that probability."""


@dataclass
class Crossing:
    """A direction that glass was asked for."""

    wo: mi.Vector3f
    reflected: mi.Bool
    """Whether it stays on the side that it came from."""
    null: mi.Bool
    """Whether it goes straight on."""
    eta: mi.Float
    """Relative index along it."""
    weight: mi.Color3f
    """f cos / p, where it is the discrete choice of smooth glass."""
    probability: mi.Float
    """Of that choice."""


def glass_of(*, weight: mi.Float, base: mi.Color3f, roughness: mi.Float, ior: mi.Float, abbe: mi.Float | None,
             thin: mi.Bool, outside: mi.Bool, left: mi.Color3f, sides: Sides | None = None) -> Glass:
    """Glass of a material. A solid is tinted by the root of `base` at each crossing, a pane by all of it: what lies
    behind either is tinted once. outside: whether the viewer's side is the air. left: see `Glass`. sides: in place of
    `outside`, where there may be glass in glass."""
    alpha = dr.square(roughness)
    if sides is not None:
        return _between(weight, base, alpha, ior, abbe, thin, left, sides)
    channels = [ior] if abbe is None else [_cauchy(ior, abbe, step) for step in ABBE_STEPS]
    indices = tuple(dr.select(thin, ior, dr.select(outside, index, dr.rcp(index))) for index in channels)
    smooth = (alpha < MIN_ALPHA) | (~thin & (ior - 1 < MIN_BEND))
    return Glass(weight=weight, tint=dr.select(thin, base, dr.sqrt(base)), indices=indices, thin=thin, smooth=smooth,
                 alpha=dr.maximum(alpha, MIN_ALPHA),
                 spreads=mi.Bool(False) if abbe is None else ~thin & (abbe > 0) & (ior > 1),
                 left=left)


def alike(glass: Glass) -> Glass:
    """The same with the densities of a path that has all channels left, which both ends of a path can tell."""
    return replace(glass, left=mi.Color3f(1))


def _between(weight: mi.Float, base: mi.Color3f, alpha: mi.Float, ior: mi.Float, abbe: mi.Float | None, thin: mi.Bool,
             left: mi.Color3f, sides: Sides) -> Glass:
    """Glass whose other side is what `sides` says: indices are ratios of both, and each tints its crossing."""
    steps = (0.0,) if abbe is None else ABBE_STEPS
    own, other = ([index if bends is None else _cauchy(index, bends, step) for step in steps]
                  for index, bends in ((ior, abbe), (sides.ior, None if abbe is None else sides.abbe)))
    ratios = [dr.select(sides.into, one / two, two / one) for one, two in zip(own, other, strict=True)]
    indices = tuple(dr.select(thin, ior, dr.select(sides.same, 1, ratio)) for ratio in ratios)
    ratio = dr.select(sides.into, ior / sides.ior, sides.ior / ior)
    smooth = (alpha < MIN_ALPHA) | (~thin & (sides.same | (dr.abs(ratio - 1) < MIN_BEND)))
    tint = dr.select(sides.same, 1, dr.sqrt(base) * sides.tint)
    bends = mi.Bool(False) if abbe is None else ((abbe > 0) & (ior > 1)) | ((sides.abbe > 0) & (sides.ior > 1))
    return Glass(weight=weight, tint=dr.select(thin, base, tint), indices=indices, thin=thin, smooth=smooth,
                 alpha=dr.maximum(alpha, MIN_ALPHA), spreads=bends & ~thin & ~sides.same, left=left)


def evaluate(glass: Glass, wi: mi.Vector3f, wo: mi.Vector3f, reflected: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
    """f cos and density of rough glass; zero where it is smooth. reflected: wo is on the viewer's side."""
    parts = [_facets(glass, wi, wo, reflected, index) for index in glass.indices]
    value = _colour([value for value, _ in parts]) * dr.select(reflected, 1, glass.tint) * glass.weight
    pdf = _expected(glass, [each for _, each in parts])
    valid = ~glass.smooth & (mi.Frame3f.cos_theta(wi) > 0) & ((mi.Frame3f.cos_theta(wo) > 0) == reflected)
    return dr.select(valid, value, 0), dr.select(valid, pdf, 0)


def scatter(glass: Glass, wi: mi.Vector3f, sample1: mi.Float, sample2: mi.Point2f) -> Crossing:
    """A channel where they differ, a facet, and by Fresnel's term F reflection or transmission.

    Smooth glass reflects with probability F and weight 1, and transmits with probability 1 - F and weight
    tint / eta^2: radiance scales by the squared ratio of the indices (Veach 1997, section 5.2).
    """
    # Channel and facet
    index, p_channel, channel_weight, rest = _channel(glass, sample1)
    normal = dr.select(glass.smooth, mi.Normal3f(0, 0, 1), _ggx(glass).sample(wi, sample2)[0])

    # Reflect or transmit
    fresnel = _fresnel(glass, dr.dot(wi, normal), index)
    _, cos_t, eta, inverse_eta = mi.fresnel(dr.dot(wi, normal), index)
    wo_reflected, reflected = mi.reflect(wi, normal), rest < fresnel
    wo_transmitted = dr.select(glass.thin, _flipped(wo_reflected), mi.refract(wi, normal, cos_t, inverse_eta))

    # Reflection is for all channels, whichever was picked: its probability is their mean, its weight F over that
    fresnels = [_fresnel(glass, mi.Frame3f.cos_theta(wi), each) for each in glass.indices]
    p_reflect = _expected(glass, fresnels)
    weight_reflect = _colour(fresnels) / p_reflect
    weight_transmit = channel_weight * glass.tint * dr.select(glass.thin, 1, dr.square(inverse_eta))
    return Crossing(wo=dr.select(reflected, wo_reflected, wo_transmitted), reflected=reflected,
                    null=~reflected & glass.thin & glass.smooth, eta=dr.select(reflected | glass.thin, 1, eta),
                    weight=dr.select(reflected, weight_reflect, weight_transmit),
                    probability=dr.select(reflected, p_reflect, (1 - fresnel) * p_channel))


def straight(glass: Glass, wi: mi.Vector3f) -> mi.Color3f:
    """What smooth panes pass straight on; 0 for all other glass."""
    passed = 1 - _fresnel(glass, mi.Frame3f.cos_theta(wi), glass.indices[0])
    return dr.select(glass.thin & glass.smooth, glass.weight * passed * glass.tint, 0)


@dr.syntax
def reflectance(glass: Glass, wi: mi.Vector3f) -> mi.Color3f:
    """Share of the light that glass of weight one sends back, from all directions: Fresnel's term where it is smooth,
    else the mean of F G1 over visible normals, which Hammersley's points pick: f cos / p = F G1(wo) for separable
    shadowing (Heitz 2018)."""
    smooth = _colour([_fresnel(glass, mi.Frame3f.cos_theta(wi), index) for index in glass.indices])
    total, i, ggx = mi.Color3f(0), mi.UInt32(0), _ggx(glass)
    while i < QUADRATURE:
        point = mi.Point2f((mi.Float(i) + 0.5) / QUADRATURE, mi.Float(dr.brev(i)) * 2.0**-32 + 0.5 / QUADRATURE)
        normal, _ = ggx.sample(wi, point)
        wo = mi.reflect(wi, normal)
        g1 = dr.select(mi.Frame3f.cos_theta(wo) > 0, ggx.smith_g1(wo, normal), 0)
        total += g1 * _colour([_fresnel(glass, dr.dot(wi, normal), index) for index in glass.indices])
        i += 1
    return dr.select(glass.smooth, smooth, total / QUADRATURE)


def _facets(glass: Glass, wi: mi.Vector3f, wo: mi.Vector3f, reflected: mi.Bool,
            index: mi.Float) -> tuple[mi.Float, mi.Float]:
    """f cos and density of one channel without tint and weight (Walter et al. 2007, equations 20, 21, 38 and 41).

    f cos = F D G cos_ih J / cos_i, p = F p(half) J, J the Jacobian of the half vector; 1 - F in transmission.
    """
    ggx, mirror = _ggx(glass), reflected | glass.thin
    wo = dr.select(glass.thin & ~reflected, _flipped(wo), wo)

    # Half vector: of reflection or refraction (equations 13 and 16)
    half = dr.normalize(wi + wo * dr.select(mirror, 1, index))
    half = mi.Normal3f(dr.mulsign(half, mi.Frame3f.cos_theta(half)))
    cos_ih, cos_oh = dr.dot(wi, half), dr.dot(wo, half)

    # Fresnel's share, and the Jacobian (equations 14 and 17)
    fresnel = _fresnel(glass, cos_ih, index)
    share = dr.select(reflected, fresnel, 1 - fresnel)
    refraction = dr.square(index) * dr.abs(cos_oh) / dr.square(cos_ih + index * cos_oh)
    jacobian = dr.select(mirror, dr.rcp(4 * cos_oh), refraction)

    # Radiance scales by 1 / eta^2 in refraction (Veach 1997, section 5.2)
    scale = dr.select(mirror, 1, dr.rcp(dr.square(index)))
    value = share * ggx.eval(half) * ggx.G(wi, wo, half) * cos_ih * jacobian * scale / mi.Frame3f.cos_theta(wi)
    met = (cos_ih > 0) & ((cos_oh > 0) == mirror)
    return dr.select(met, value, 0), dr.select(met, share * ggx.pdf(wi, half) * jacobian, 0)


def _channel(glass: Glass, sample: mi.Float) -> tuple[mi.Float, mi.Float, mi.Color3f, mi.Float]:
    """The index to follow, with which probability, the weight of each channel, which makes up for those that are given
    up, and what is left of the random number."""
    if len(glass.indices) == 1:
        return glass.indices[0], mi.Float(1), mi.Color3f(1), sample
    (red, green, blue), total = glass.left, _total(glass)
    sample = dr.minimum(sample * total, total * (1 - 2**-22))
    is_red, is_blue = sample < red, sample >= red + green
    index = dr.select(is_red, glass.indices[0], dr.select(is_blue, glass.indices[2], glass.indices[1]))
    below = dr.select(is_red, 0, dr.select(is_blue, red + green, red))
    level = dr.select(is_red, red, dr.select(is_blue, blue, green))
    picked = mi.Color3f(dr.select(is_red, mi.Float(1), 0), dr.select(is_red | is_blue, mi.Float(0), 1),
                        dr.select(is_blue, mi.Float(1), 0))
    weight = dr.select(glass.spreads, picked * (total / level), 1)
    return index, dr.select(glass.spreads, level / total, 1), weight, (sample - below) / level


def _expected(glass: Glass, channels: list[mi.Float]) -> mi.Float:
    """Mean over the channels that a path may follow."""
    if len(channels) == 1:
        return channels[0]
    return dr.dot(mi.Color3f(*channels), glass.left) / _total(glass)


def _total(glass: Glass) -> mi.Float:
    red, green, blue = glass.left
    return red + green + blue


def _fresnel(glass: Glass, cosine: mi.Float, index: mi.Float) -> mi.Float:
    """Reflected share of unpolarised light: F of one face, or 2 F / (1 + F) of a pane's two, the sum of all
    reflections between them."""
    face = mi.fresnel(cosine, index)[0]
    return dr.select(glass.thin, 2 * face / (1 + face), face)


def _cauchy(ior: mi.Float, abbe: mi.Float, step: float) -> mi.Float:
    """Index of a channel: n = n_d + step (n_d - 1) / V, see `ABBE_STEPS`."""
    main_dispersion = dr.select(abbe > 0, (ior - 1) * dr.rcp(dr.maximum(abbe, 1e-6)), 0)
    return dr.maximum(dr.fma(step, main_dispersion, ior), 1)


def _colour(channels: list[mi.Float]) -> mi.Color3f:
    return mi.Color3f(channels[0]) if len(channels) == 1 else mi.Color3f(*channels)


def _flipped(direction: mi.Vector3f) -> mi.Vector3f:
    return mi.Vector3f(direction.x, direction.y, -direction.z)


def _ggx(glass: Glass) -> mi.MicrofacetDistribution:
    return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, glass.alpha, sample_visible=True)
