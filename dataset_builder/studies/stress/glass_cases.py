"""Glass, clear and rough, thick and thin: what it reflects and what it transmits add up to what arrives."""

import math
from dataclasses import replace

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.studies.stress.bench import Shot, judged, render
from dataset_builder.studies.stress.case import CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.material_cases import (
    DEEP,
    ENERGY,
    SEEN,
    SKY,
    WHITE,
    beyond,
    furnace,
    kept,
    undiffuse,
)
from dataset_builder.studies.stress.scenes import WIDE, ball, matte, quad

GLASS = Material(name="glass", base_color=WHITE, roughness=0.0, transmission=1.0)


@hard_case(name="material/clear-glass", bound=0.01, figure=ENERGY,
           expectation="a ball of clear white glass under a white sky cannot be told from the sky",
           failure="dark rims: light that is totally reflected inside gets lost, or radiance is not scaled by n^2")
def clear_glass(size: Size) -> CaseMeasured:
    """Reflection and refraction share all of the light."""
    picture = furnace(GLASS, size, spp=4)
    return judged(picture, kept(picture), diffuse=False, also=(*undiffuse(picture), *beyond(picture)))


ROUGH = math.sqrt(0.1)
ROUGH_BALL = 0.9492
"""Mean of I over the frame of `SEEN` with a sphere of Mitsuba's own `roughdielectric` (GGX, alpha 0.1, index 1.5) under
a sky of 1, `path` of depth 64 at 1024 spp: single scattering between microfacets loses the rest."""


@hard_case(name="material/rough-glass", bound=0.005, figure="deviation from Mitsuba's rough dielectric, relative",
           expectation="a ball of rough white glass loses what Mitsuba's own rough glass loses, and gains nothing",
           failure="glass that shines, or is as dark as stone: Jacobians of refraction")
def rough_glass(size: Size) -> CaseMeasured:
    """Alpha 0.1; the frame's mean is the same at every resolution."""
    picture = furnace(replace(GLASS, roughness=ROUGH), size, spp=4)
    return judged(picture, abs(float(picture.i.mean()) / ROUGH_BALL - 1), diffuse=False,
                  also=(*undiffuse(picture), *beyond(picture)))


@hard_case(name="material/dispersive-glass", bound=0.01, figure=ENERGY,
           expectation="glass of Abbe number 20 keeps the energy of every channel",
           failure="a colour cast: one channel's paths are weighted by another's probability")
def dispersive_glass(size: Size) -> CaseMeasured:
    """The worst of the three channels."""
    picture = furnace(replace(GLASS, abbe=20.0), size, spp=8)
    inside = picture.mask > 1 - 1e-6
    return judged(picture, float(np.abs(picture.i[inside].mean(axis=0) - 1).max()), diffuse=False,
                  also=undiffuse(picture))


@hard_case(name="material/thin-pane", bound=0.01, figure=ENERGY,
           expectation="a pane of thin glass under a white sky cannot be told from the sky",
           failure="a grey pane: what it reflects and what it transmits do not add up")
def thin_pane(size: Size) -> CaseMeasured:
    """Upright, before the camera."""
    pane = quad(replace(GLASS, thin=True), (-3, 0, -3), (6, 0, 0), (0, 0, 6), instance=1)
    picture = render(pane, SKY, Shot(camera=SEEN, max_depth=DEEP), size)
    return judged(picture, kept(picture), diffuse=False, also=(*undiffuse(picture), *beyond(picture)))


@hard_case(name="material/ior-1", bound=5e-3, figure="deviation of the mean of I, relative",
           expectation="a ball of index of refraction 1 cannot be seen",
           failure="NaN: Fresnel's terms and the direction of refraction are 0 / 0 there")
def ior_one(size: Size) -> CaseMeasured:
    """Before a wall that is half as bright as the sky: the picture with the ball against the one without."""
    wall = quad(matte(0.5), (-WIDE, 3, -WIDE), (2 * WIDE, 0, 0), (0, 0, 2 * WIDE))
    air = replace(GLASS, ior=1.0, specular=0.0)
    shot = Shot(camera=SEEN, max_depth=8, spp=4 * size.spp)
    picture, bare = (render(soup, SKY, shot, size) for soup in (merge([ball(air), wall]), wall))
    inside = picture.mask > 1 - 1e-6
    off = abs(float(picture.i[inside].mean() / bare.i[inside].mean()) - 1)
    return judged(picture, off, diffuse=False, also=undiffuse(picture, inside))
