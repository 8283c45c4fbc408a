"""Directions through portals and points on them: solid angles by formulas, densities that samples follow."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.label.scene_plan import PortalPlan
from dataset_builder.rendering.transport.portals import ALL_ROUND, Portals, portals_of
from tests.small_scenes import light, lit_by

NORTH = PortalPlan(corner=(-1, 2, 0.9), right=(2, 0, 0), up=(0, 0, 1.2))
WEST = PortalPlan(corner=(-2, -1, 0.5), right=(0, 1.5, 0), up=(0, 0, 1))
COUNT = 1 << 18
POINTS = [(0.4, -0.7, 0.2), (-1.4, 0.9, 1.2), (1.8, 1.7, 2.4), (0.3, 1.9, 1.1)]
"""One of them near a portal, one that sees both steeply."""


def at(point):
    """A point as a value on the device."""
    return mi.Point3f(*(dr.opaque(mi.Float, float(value)) for value in point))


def numbers(seed):
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, COUNT)
    return sampler


def solid_angle(low, high, height):
    """Of a rectangle in a plane at `height`, from the origin: the sum over its corners of +-atan(x y / (h r))."""
    def corner(x, y):
        return np.arctan2(x * y, height * np.sqrt(x * x + y * y + height * height))

    return corner(*high) - corner(high[0], low[1]) - corner(low[0], high[1]) + corner(*low)


def seen(portal, point):
    """(2,) low and (2,) high corner in the portal's plane from the foot of a point, and the point's height."""
    right, up = np.array(portal.right), np.array(portal.up)
    offset = np.array(portal.corner) - point
    low = np.array([offset @ right / np.linalg.norm(right), offset @ up / np.linalg.norm(up)])
    inward = np.cross(right, up)
    return low, low + np.linalg.norm([right, up], axis=1), -offset @ inward / np.linalg.norm(inward)


def test_the_side_of_a_cube_takes_a_sixth_of_all_directions():
    side = PortalPlan(corner=(-1, 1, -1), right=(2, 0, 0), up=(0, 0, 2))
    assert Portals([side], 0.1).solid_angle(at((0, 0, 0)))[0] == pytest.approx(4 * np.pi / 6, rel=1e-6)


@pytest.mark.parametrize("point", POINTS)
def test_solid_angles_are_those_of_the_formula(point):
    expected = [solid_angle(*seen(portal, np.array(point))) for portal in (NORTH, WEST)]
    for portal, own in zip((NORTH, WEST), expected, strict=True):
        assert Portals([portal], 0.1).solid_angle(at(point))[0] == pytest.approx(own, rel=1e-4)
    assert Portals([NORTH, WEST], 0.1).solid_angle(at(point))[0] == pytest.approx(sum(expected), rel=1e-4)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_the_unit_of_length_does_not_matter(unit):
    scaled = PortalPlan.model_validate({key: tuple(unit * value for value in side)
                                        for key, side in NORTH.model_dump().items()})
    point = np.array(POINTS[0])
    direction, pdf = Portals([scaled], 0.1).sample(at(unit * point), mi.Point2f(0.3, 0.7))
    same, expected = Portals([NORTH], 0.1).sample(at(point), mi.Point2f(0.3, 0.7))
    assert np.allclose(direction, same, atol=1e-5) and np.allclose(pdf, expected, rtol=1e-4)


@pytest.mark.parametrize("point", POINTS)
def test_samples_are_even_over_the_solid_angle(point):
    """Of 6 x 5 cells of the rectangle each gets its part of the samples. Fails by chance once in 1,000 runs."""
    low, high, height = seen(NORTH, np.array(point))
    direction, pdf = Portals([NORTH], 0.1).sample(at(point), numbers(3).next_2d())
    x, y, z = np.array(direction)
    assert np.allclose(np.linalg.norm(direction, axis=0), 1, atol=1e-6)
    edges = [np.linspace(low[k], high[k], 7 - k) for k in range(2)]
    found = np.histogram2d(height * x / y, height * z / y, bins=edges)[0]
    expected = np.array([[solid_angle((left, bottom), (right, top), height)
                          for bottom, top in zip(edges[1], edges[1][1:], strict=False)]
                         for left, right in zip(edges[0], edges[0][1:], strict=False)])
    # A cell's edge may take one that lies on it to either side, and those on the rim may fall out
    assert found.sum() > COUNT - 20
    _, p = stats.chisquare(found.ravel(), (expected / expected.sum() * found.sum()).ravel())
    assert p > 0.001 / len(POINTS)
    assert np.allclose(pdf, 1 / expected.sum(), rtol=1e-4)


@pytest.mark.parametrize("portals", [[NORTH], [NORTH, WEST], [NORTH, NORTH], [NORTH, WEST, WEST]])
def test_the_density_is_that_of_the_samples_and_integrates_to_one(portals):
    """Portals that lie in each other count twice. Each assertion fails by chance once in 10,000 runs."""
    made = Portals(portals, 0.1)
    for number, point in enumerate(POINTS):
        sampler = numbers(number)
        everywhere = mi.warp.square_to_uniform_sphere(sampler.next_2d())
        over_all = 4 * np.pi * np.array(made.pdf(at(point), everywhere))
        assert abs(over_all.mean() - 1) < 4 * over_all.std() / np.sqrt(COUNT)
        direction, pdf = made.sample(at(point), sampler.next_2d())
        again = np.array(made.pdf(at(point), direction))
        # Rounding may put a direction on the other side of a portal's rim
        assert np.mean(np.abs(again - pdf) > 1e-3 * np.array(pdf)) < 1e-4
        for moment in (lambda v: v[0], lambda v: v[2], lambda v: v[0] * v[1]):
            drawn, weighed = moment(np.array(direction)), moment(np.array(everywhere)) * over_all
            assert abs(drawn.mean() - weighed.mean()) < 4 * np.hypot(drawn.std(), weighed.std()) / np.sqrt(COUNT)


def test_a_portal_is_none_from_outside_and_in_its_plane():
    made = Portals([NORTH], 0.1)
    for point in ((0, 3, 1.2), (0, 2, 1.2), (3, 2, 1.2), (0, 2.1, 0)):
        assert made.solid_angle(at(point))[0] == 0
        assert made.sample(at(point), mi.Point2f(0.5, 0.5))[1][0] == 0
        assert made.mixed(at(point), mi.Vector3f(0, 1, 0), mi.Float(0), mi.Float(0.3), 1, mi.Bool(True))[0] \
            == pytest.approx(0.3)
    inside = at((0, 0, 1.2))
    assert made.crossed(inside, mi.Vector3f(0, 1, 0))[0] == 1
    assert made.crossed(inside, mi.Vector3f(0, -1, 0))[0] == 0
    assert made.crossed(inside, dr.normalize(mi.Vector3f(0.6, 1, 0)))[0] == 0
    assert Portals([NORTH, NORTH], 0.1).crossed(inside, mi.Vector3f(0, 1, 0))[0] == 2


def test_points_on_portals_are_even_over_their_area():
    """2.4 and 1.5 square metres, 4 x 4 cells of each. Fails by chance once in 1,000 runs."""
    point, normal, pdf = Portals([NORTH, WEST], 0.1).sample_area(numbers(5).next_2d())
    points, normals = np.array(point).T, np.array(normal).T
    assert np.allclose(pdf, 1 / 3.9, rtol=1e-6)
    counts = []
    for portal, inward in ((NORTH, (0, -1, 0)), (WEST, (1, 0, 0))):
        own = np.abs(normals - inward).max(axis=1) < 1e-6
        right, up = np.array(portal.right), np.array(portal.up)
        offset = points[own] - portal.corner
        assert np.abs(offset @ np.array(inward)).max() < 1e-6
        u, v = offset @ right / (right @ right), offset @ up / (up @ up)
        cells = np.histogram2d(u, v, bins=4, range=[[-1e-5, 1 + 1e-5]] * 2)[0]
        counts.append(cells)
    found, area = np.array(counts), np.array([2.4, 1.5])[:, None, None] / 16
    assert found.sum() == COUNT
    assert stats.chisquare(found.ravel(), np.broadcast_to(area / 3.9 * COUNT, found.shape).ravel())[1] > 0.001


def test_portals_are_for_domes_that_shine():
    made = portals_of([NORTH], lit_by(light("dome"), light("area")))
    assert made is not None and made.share[0] == np.float32(ALL_ROUND)
    assert portals_of([], lit_by(light("dome"))) is None
    assert portals_of([NORTH], lit_by(light("area"))) is None
    assert portals_of([NORTH], lit_by(light("dome", weight=0))) is None
    assert portals_of([NORTH], None) is None
