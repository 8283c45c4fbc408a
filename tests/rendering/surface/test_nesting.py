"""Glass in glass at one surface: who owns what, Fresnel's and Snell's laws of both sides, and what paths count."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.assets.asset import Material
from dataset_builder.assets.glass_bodies import MOST_BODIES, glass_bodies
from dataset_builder.errors import PlanError
from dataset_builder.rendering.surface.nesting import BITS, crossed, inside_of, left_of, owner, time_of
from tests.rendering.surface.surface_bench import interaction, mean_and_error, sampled, surface_of

GLASS = Material(name="glass", base_color=(0.81, 0.9, 1), roughness=0.0, transmission=1.0, ior=1.5, priority=2)
WATER = Material(name="water", base_color=(1, 0.64, 0.25), roughness=0.0, transmission=1.0, ior=1.33, priority=1)
IN_WATER, IN_GLASS, AIR = 1, 1 << BITS, 0
"""Counts: water is body 1, glass body 2."""


def fresnel(n1, n2, cosine):
    """Share that is reflected on the way from index n1 to n2, and cosine beyond; by hand."""
    sine = n1 / n2 * np.sqrt(1 - cosine**2)
    if sine >= 1:
        return 1.0, 0.0
    beyond = np.sqrt(1 - sine**2)
    across, along = ((n1 * cosine - n2 * beyond) / (n1 * cosine + n2 * beyond),
                     (n2 * cosine - n1 * beyond) / (n2 * cosine + n1 * beyond))
    return (across**2 + along**2) / 2, beyond


def seen(material, inside, cosine, width=4096):
    """A surface, and points of its face that a path in `inside` meets."""
    surface, si = surface_of(WATER, GLASS), interaction(cosine, width)
    si.prim_index = dr.full(mi.UInt32, [WATER, GLASS].index(material), width)
    si.time = time_of(None, dr.full(mi.UInt32, inside, width))
    return surface, si


@pytest.mark.parametrize("material, inside, outer, n1, n2, tint", [
    (GLASS, AIR, True, 1.0, 1.5, np.sqrt(GLASS.base_color)),
    (GLASS, IN_WATER, True, 1.33, 1.5, np.sqrt(np.multiply(WATER.base_color, GLASS.base_color))),
    (GLASS, IN_GLASS | IN_WATER, False, 1.5, 1.33, np.sqrt(np.multiply(WATER.base_color, GLASS.base_color))),
    (GLASS, IN_GLASS, False, 1.5, 1.0, np.sqrt(GLASS.base_color)),
    (WATER, AIR, True, 1.0, 1.33, np.sqrt(WATER.base_color)),
    (WATER, IN_WATER, False, 1.33, 1.0, np.sqrt(WATER.base_color)),
    (WATER, AIR, False, 1.33, 1.0, np.sqrt(WATER.base_color)),
    (WATER, IN_GLASS, True, 1.0, 1.0, np.ones(3)),
    (WATER, IN_GLASS | IN_WATER, False, 1.0, 1.0, np.ones(3))])
@pytest.mark.parametrize("cosine", [0.9, 0.4])
def test_an_interface_follows_fresnel_and_snell_of_both_sides(material, inside, outer, n1, n2, tint, cosine):
    surface, si = seen(material, inside, cosine if outer else -cosine)
    share, beyond = fresnel(n1, n2, cosine)
    _, r, _ = surface.reflectance(si, mi.Bool(True))
    assert np.allclose(np.array(r)[:, 0], share, atol=2e-6)
    bs, weight = sampled(surface, si, width=4096)
    z = np.array(bs.wo.z) * (1 if outer else -1)
    through = z < 0
    assert abs(through.mean() - (1 - share)) < 5 * np.sqrt(share * (1 - share) / len(z)) + 1e-9
    assert np.allclose(z[~through], cosine, atol=1e-6) and np.allclose(z[through], -beyond, atol=1e-5)
    assert np.allclose(weight[:, ~through].T, 1) and np.allclose(weight[:, through].T, tint * (n1 / n2) ** 2, rtol=1e-5)
    assert np.allclose(np.array(bs.eta)[through], n2 / n1, rtol=1e-6)


def test_light_is_scaled_by_the_squared_ratio_of_indices_and_no_more():
    surface, si = seen(GLASS, IN_WATER, 0.7)
    mean, error = mean_and_error(sampled(surface, si, width=4096)[1])
    share, _ = fresnel(1.33, 1.5, 0.7)
    tint = np.sqrt(np.multiply(WATER.base_color, GLASS.base_color))
    assert np.all(np.abs(mean - share - (1 - share) * tint * (1.33 / 1.5) ** 2) < 5 * error + 1e-6)


def test_counts_find_the_owner_and_forget_nothing():
    inside = mi.UInt32(0)
    for body, entering, expected in ((1, True, 1), (3, True, 3), (2, True, 3), (3, False, 2), (3, False, 2),
                                     (2, True, 2), (2, False, 2), (2, False, 1), (1, False, 0), (0, True, 0)):
        inside = crossed(inside, mi.UInt32(body), mi.Bool(entering))
        assert owner(inside)[0] == expected
    for _ in range(20):
        inside = crossed(inside, mi.UInt32(MOST_BODIES), mi.Bool(True))
    full = time_of(mi.Color3f(0.5, 0, 1), inside)
    assert owner(inside)[0] == MOST_BODIES and inside_of(full)[0] == inside[0]
    assert np.array(left_of(full)).ravel().tolist() == [4, 0, 7]


def test_the_order_of_ownership_is_that_of_priority_and_has_room_for_five():
    ice = Material(name="ice", base_color=(1, 1, 1), transmission=1.0, ior=1.31, priority=3)
    plain = Material(name="plain", base_color=(1, 1, 1), transmission=1.0)
    assert [body.ior for body in glass_bodies([ice, plain, GLASS, WATER, GLASS])] == [1.33, 1.5, 1.31]
    many = [Material(name=f"glass {i}", base_color=(1, 1, 1), transmission=1.0, priority=1 + i) for i in range(6)]
    with pytest.raises(PlanError, match="at most 5 kinds of glass with a priority in a scene, got 6"):
        glass_bodies(many)
