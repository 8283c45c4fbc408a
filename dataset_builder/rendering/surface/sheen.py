"""Sheen of fibres: the Charlie lobe, and how much of the light it takes.

f = colour D V with D = (2 + 1/alpha) sin(theta_h)^(1/alpha) / (2 pi) (Estevez and Kulla, "Production friendly
microfacet sheen BRDF", SIGGRAPH 2017 course notes, equation 2), alpha = roughness squared and
V = 1 / (4 (cos_i + cos_o - cos_i cos_o)) (Neubelt and Pettineo, "Crafting a next-gen material pipeline for The Order:
1886", 2013), as KHR_materials_sheen has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.rendering.surface.reflectance import ROUGHNESSES, cosines

MIN_ROUGHNESS = 0.1
"""Smaller ones are taken as this: such a rim is thinner than a pixel, and a cosine lobe never finds it."""

HEIGHTS, TURNS = 96, 64
"""Quadrature points over the hemisphere of the other direction."""


@dataclass
class Sheen:
    """The lobe at a point."""

    colour: mi.Color3f
    """With what the layers above leave over."""
    reflectance: mi.Color3f
    exponent: mi.Float
    """Charlie's."""


def exponent_of(roughness: mi.Float) -> mi.Float:
    """1 / alpha."""
    return dr.rcp(dr.square(dr.maximum(roughness, MIN_ROUGHNESS)))


def evaluate(sheen: Sheen, wi: mi.Vector3f, wo: mi.Vector3f, half: mi.Vector3f) -> mi.Color3f:
    """f cos_o for directions above the surface, in the frame of the shading normal: colour D V cos_o."""
    cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
    sine2 = dr.maximum(1 - dr.square(mi.Frame3f.cos_theta(half)), 0)
    # D (Estevez and Kulla 2017, equation 2), with sin^(1 / alpha) as (sin^2)^(1 / (2 alpha))
    d = (2 + sheen.exponent) * (0.5 * dr.inv_pi) * dr.power(sine2, 0.5 * sheen.exponent)
    # V (Neubelt and Pettineo 2013)
    return sheen.colour * (d * cos_o / (4 * (cos_i + cos_o - cos_i * cos_o)))


@cache
def sheen_table() -> np.ndarray:
    """(ROUGHNESSES, COSINES) float32: directional reflectance of white sheen, at roughness i / (ROUGHNESSES - 1) and
    cosine `cosines()[j]`, by midpoint quadrature whose points crowd at the horizon: cos_o = t squared."""
    mu = cosines()[:, None]
    exponents = np.maximum(np.linspace(0, 1, ROUGHNESSES), MIN_ROUGHNESS) ** -2.0
    t, turn = (np.arange(HEIGHTS) + 0.5) / HEIGHTS, np.pi * (np.arange(TURNS) + 0.5) / TURNS
    cos_o, phi = np.repeat(t**2, TURNS), np.tile(turn, HEIGHTS)
    area = np.repeat(2 * t / HEIGHTS, TURNS) * 2 * np.pi / TURNS
    # cos_h = (cos_i + cos_o) / |wi + wo|, |wi + wo|^2 = 2 + 2 wi . wo
    dot = np.sqrt((1 - mu**2) * (1 - cos_o**2)) * np.cos(phi) + mu * cos_o
    cos2_h = (mu + cos_o) ** 2 / np.maximum(2 + 2 * dot, 1e-12)
    log_sine = 0.5 * np.log(np.maximum(1 - cos2_h, 1e-30))
    weight = area * cos_o / (4 * (mu + cos_o - mu * cos_o)) / (2 * np.pi)
    table = np.stack([np.sum((2 + e) * np.exp(e * log_sine) * weight, axis=1) for e in exponents]).astype(np.float32)
    table.flags.writeable = False
    return table
