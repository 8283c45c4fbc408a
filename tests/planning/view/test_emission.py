"""What lights send, against published values and integrals."""

from math import pi
from typing import get_args

import numpy as np
import pytest

from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LampName
from dataset_builder.planning.view.emission import (
    BEAM_SHARE,
    LUMINANCE,
    REC709_FROM_XYZ,
    chromaticity,
    colour,
    direct_irradiance,
    facing_irradiance,
    sky_directions,
)


@pytest.mark.parametrize(("temperature", "x", "y"), [
    (2856, 0.4476, 0.4074),  # CIE illuminant A is a black body
    (6500, 0.3135, 0.3237),  # Planckian locus, Wyszecki and Stiles, table 1(3.11)
    (4000, 0.3805, 0.3768),
    (10000, 0.2807, 0.2884),
])
def test_the_chromaticity_is_the_tabulated_one(temperature: float, x: float, y: float) -> None:
    assert chromaticity(temperature) == pytest.approx((x, y), abs=2e-3)


@pytest.mark.parametrize("temperature", [1000.0, 1900.0, 2856.0, 6504.0, 40000.0])
def test_colours_have_luminance_one_and_no_negative_channel(temperature: float) -> None:
    assert LUMINANCE @ np.array(colour(temperature)) == pytest.approx(1)
    assert min(colour(temperature)) >= 0


def test_hotter_is_bluer() -> None:
    ratios = [colour(t)[2] / colour(t)[0] for t in (1500, 2500, 4000, 6500, 9000, 20000)]
    assert ratios == sorted(ratios)


def test_daylight_is_almost_white() -> None:
    assert colour(6504.0) == pytest.approx((1, 1, 1), abs=0.06)


def test_the_luminance_of_the_primaries_is_a_row_of_the_inverse_matrix() -> None:
    assert np.linalg.inv(REC709_FROM_XYZ)[1] == pytest.approx(LUMINANCE, abs=1e-9)


def light(kind: str, **more: object) -> LightPlan:
    plain = {"kind": kind, "position": (0.0, 0.0, 2.0), "direction": (0.0, 0.0, -1.0), "size": 0.1, "cutoff": 30.0,
             "radiance": (1.0, 2.0, 4.0), "temperature": 0.0, "weight": 1.0}
    return LightPlan.model_validate(plain | more)


def integrate(inside: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray, cos_light: np.ndarray) -> float:
    """Irradiance at the origin, facing +Z, of unit radiance from surface elements of area `inside`."""
    squared = x**2 + y**2 + z**2
    return float((inside * z / np.sqrt(squared) * cos_light / squared).sum())


@pytest.mark.parametrize(("side", "distance"), [(0.2, 1.5), (1.0, 1.0), (3.0, 0.5)])
def test_a_square_sends_what_integration_says(side: float, distance: float) -> None:
    n = 800
    axis = ((np.arange(n) + 0.5) / n - 0.5) * side
    x, y = np.meshgrid(axis, axis)
    z = np.full_like(x, distance)
    area = np.full_like(x, (side / n) ** 2)
    expected = integrate(area, x, y, z, distance / np.sqrt(x**2 + y**2 + z**2))
    assert facing_irradiance("area", side, distance) == pytest.approx(expected, rel=1e-4)


def test_a_square_is_a_half_space_from_very_near_and_a_point_from_afar() -> None:
    assert facing_irradiance("area", 1.0, 1e-4) == pytest.approx(pi, rel=1e-3)
    assert facing_irradiance("area", 1.0, 100.0) == pytest.approx(1e-4, rel=1e-3)


def test_a_sphere_sends_its_solid_cone() -> None:
    """pi sin^2 of the half angle under which it is seen, by integration over directions."""
    radius, distance = 0.5, 1.25
    half_angle = np.arcsin(radius / distance)
    theta = (np.arange(20000) + 0.5) / 20000 * half_angle
    expected = float((np.cos(theta) * 2 * pi * np.sin(theta)).sum() * half_angle / 20000)
    assert facing_irradiance("sphere", radius, distance) == pytest.approx(expected, rel=1e-6)


def test_points_fall_off_with_the_square_and_a_dome_is_pi() -> None:
    assert facing_irradiance("point", 0, 2) == facing_irradiance("spot", 0, 2) == 0.25
    assert facing_irradiance("dome", 0, 1) == pi and facing_irradiance("sun", 0, 1) == 1


@pytest.mark.parametrize("kind", get_args(LampName))
def test_right_below_a_light_it_is_the_facing_irradiance(kind: str) -> None:
    found = direct_irradiance(light(kind), np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
    assert found[0] == pytest.approx(facing_irradiance(kind, 0.1, 2.0) * np.array([1, 2, 4]))


def test_surfaces_that_look_away_and_backs_of_squares_get_nothing() -> None:
    down, up = np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0]])
    assert not direct_irradiance(light("point"), np.zeros((1, 3)), down).any()
    assert not direct_irradiance(light("area", direction=(0.0, 0.0, 1.0)), np.zeros((1, 3)), up).any()
    tilted = direct_irradiance(light("point"), np.zeros((1, 3)), np.array([[0.6, 0.0, 0.8]]))
    assert tilted[0] == pytest.approx(0.8 * 0.25 * np.array([1, 2, 4]))


def test_a_spot_falls_off_linearly_to_its_cutoff() -> None:
    angles = np.radians([0.0, 30 * BEAM_SHARE, 30 * (1 + BEAM_SHARE) / 2, 30.0, 40.0])
    points = np.stack([2 * np.tan(angles), np.zeros(5), np.zeros(5)], axis=1)
    towards = np.array([0.0, 0.0, 2.0]) - points
    distance = np.linalg.norm(towards, axis=1)
    found = direct_irradiance(light("spot"), points, towards / distance[:, None])[:, 0] * distance**2
    assert found == pytest.approx([1, 1, 0.5, 0, 0], abs=1e-9)


def test_sky_directions_are_cosine_distributed() -> None:
    directions = sky_directions(4000)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(4000))
    assert directions[:, 2].mean() == pytest.approx(2 / 3, abs=1e-3)
    assert np.abs(directions[:, :2].mean(axis=0)).max() < 2e-3
