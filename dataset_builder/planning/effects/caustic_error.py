"""How noisy caustics come out: the relative error of a pixel's caustic light that is to be expected.

By camera paths a diffuse surface finds a lamp by way of a caster where a direction of its cosine lobe, after the
caster, lands on the lamp or within a lobe of it. With Omega the solid angle of both, seen from the caster, a share

    p = Omega / (pi SPREAD)

of paths does, and the rest brings nothing: the relative variance of a pixel is 1 / (p spp). SPREAD is what the
curvature of a round caster takes of that, or adds to it. By joined paths light comes from the lamp's side, whatever the
lamp's size and the lobe: the relative variance is HEAVY s / spp with s camera samples to a light path. Where both find
the light, the inverses of their variances add up. The constants were measured, see `docs/effects.md`; errors are within
a factor of about two of what was found there.
"""

from math import dist, inf, log2, pi, sqrt

import numpy as np

from dataset_builder.label.scene_plan import LightPlan, Vector
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.view.emission import facing_irradiance

SPREAD = {False: 13.0, True: 0.85}
"""Of balls of chrome, and of glass, which gather what chrome scatters; under lamps of 3 to 30 cm."""
HEAVY = {False: 40.0, True: 10.0}
"""Of the same: 9 to 58 off chrome, 2 to 11 through glass."""
LOBE = {False: 3.0, True: 0.8}
"""Solid angle of a rough lobe within which lights are found, over pi alpha^2: off chrome, and through glass."""
TINY = 1e-9
"""Least solid angle of what has any extent, and distance."""
SMOOTHEST = 1e-3
"""Least alpha of metal and coats, as rendering has it."""
SAMPLES_PER_PATH = {False: 24, True: 8}
"""Camera samples of a group for each of its light paths, without caustics and with them."""
FEWEST, MOST = 5, 9
"""Light paths of a group, as powers of four: full grids of strata, and few sizes."""
BLOCK, PROMISED, SAFETY = 8, 0.5, 2.0
"""*simulated* promises that over blocks of 8x8 pixels caustic light has at most this error, root mean square; it is
said where half of that is expected."""


def paths_for(samples: int, caustics: bool) -> int:
    """Light paths of a group: few, but none used so much that its noise shows."""
    return int(4 ** np.clip(round(log2(max(samples, 1) / SAMPLES_PER_PATH[caustics]) / 2), FEWEST, MOST))


def lamp_angle(light: LightPlan, place: Vector) -> float:
    """Solid angle of a light from a place, steradians, as if it faced it: 0 without extent, 2 pi of a dome."""
    if not LIGHT_KINDS[light.kind].extended:
        return 0.0
    if LIGHT_KINDS[light.kind].outside:
        return 2 * pi
    distance = max(dist(light.position, place), light.size, TINY)
    return max(facing_irradiance(light.kind, light.size, distance, light.length), TINY)


def lobe_angle(roughness: float, glass: bool) -> float:
    """Solid angle within which a lobe of a roughness finds a light, steradians; 0 of smooth glass."""
    alpha = roughness**2 if glass else max(roughness**2, SMOOTHEST)
    return LOBE[glass] * pi * alpha**2


def camera_error(angle: float, spp: int, glass: bool) -> float:
    """Expected relative error of a pixel's caustic light by camera paths; infinite where no path meets it."""
    if angle <= 0:
        return inf
    return sqrt(pi * SPREAD[glass] / angle / max(spp, 1))


def joined_error(angle: float, spp: int, glass: bool, *, pixels: int, batches: int) -> float:
    """The same where light paths follow the caustic, too, to a diffuse surface that the camera sees. pixels: of the
    frame."""
    group = pixels * max(spp // batches, 1)
    followed = HEAVY[glass] * group / paths_for(group, True) / max(spp, 1)
    return 1 / sqrt(1 / followed + camera_error(angle, spp, glass) ** -2)


def shows(error: float) -> bool:
    """Whether light with an error is simulated."""
    return error <= BLOCK * PROMISED / SAFETY


def told_error(error: float) -> str:
    """An error in words, to two digits.

    >>> told_error(0.0834), told_error(4.56), told_error(123)
    ('8.3%', '460%', '12,000%')
    """
    percent = float(f"{100 * error:.2g}")
    return f"{percent:,.0f}%" if percent >= 10 else f"{percent:g}%"
