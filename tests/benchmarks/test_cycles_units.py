"""Light in our units and in Blender's: closed forms."""

import math

import numpy as np
import pytest

from benchmarks.cycles import units


def test_a_point_sends_its_intensity_over_the_sphere() -> None:
    theta = (np.arange(1000) + 0.5) * math.pi / 1000
    flux = np.sum(3.0 * np.sin(theta)) * math.pi / 1000 * 2 * math.pi
    assert units.point_power(3.0) == pytest.approx(flux, rel=1e-5)


def test_a_square_sends_its_cosine_over_the_hemisphere() -> None:
    theta = (np.arange(1000) + 0.5) * math.pi / 2000
    flux = np.sum(5.0 * 0.4**2 * np.cos(theta) * np.sin(theta)) * math.pi / 2000 * 2 * math.pi
    assert units.area_power(5.0, 0.4) == pytest.approx(flux, rel=1e-5)


def test_a_sphere_seen_from_afar_is_a_point() -> None:
    radiance, radius = 7.0, 0.2
    assert units.sphere_power(radiance, radius) == pytest.approx(units.point_power(radiance * math.pi * radius**2))


@pytest.mark.parametrize(("kind", "expected"), [("sun", 2.0), ("point", 8 * math.pi), ("spot", 8 * math.pi),
                                                ("area", 2 * math.pi * 0.09), ("sphere", 8 * math.pi**2 * 0.09)])
def test_power_by_kind(kind: str, expected: float) -> None:
    assert units.power(kind, 2.0, 0.3) == pytest.approx(expected)


def test_tint_times_peak_is_the_radiance() -> None:
    tint, peak = units.tint_and_peak((0.5, 4.0, 1.0))
    assert max(tint) == 1 and np.allclose(np.array(tint) * peak, (0.5, 4.0, 1.0))
    assert units.tint_and_peak((0.0, 0.0, 0.0)) == ((0.0, 0.0, 0.0), 0.0)


def test_the_fade_of_a_spot_spans_cosines_of_beam_to_cutoff() -> None:
    blend, edge = units.spot_blend(60.0, 45.0), math.cos(math.radians(60))
    assert edge + blend * (1 - edge) == pytest.approx(math.cos(math.radians(45)))
    assert units.spot_blend(60.0, 60.0) == pytest.approx(0) and units.spot_blend(60.0, 0.0) == pytest.approx(1)


def test_level_half_is_an_index_of_one_and_a_half() -> None:
    assert units.specular_level(((1.5 - 1) / (1.5 + 1)) ** 2) == pytest.approx(0.5)


def test_two_edges_are_direct_light_only() -> None:
    assert [units.indirect_bounces(depth) for depth in (1, 2, 3, 12)] == [0, 0, 1, 10]
