"""Every embedded family keeps volume, extent and closedness when it is made rough at sigma 0."""

from functools import lru_cache

import numpy as np
import pytest

from dataset_builder.assets.procedural.furniture import make_furniture
from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.rough_base import rough_base
from dataset_builder.seeding import rng
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.numbers import draw
from tests.geometry.closed import watertight


@lru_cache(maxsize=1)
def furniture(family, index):
    """A piece with every parameter as drawn, or (indices -1 and -2) at its lower or upper limit."""
    params = {param.name: draw(param.default, rng(index & 7, family, param.name)) if index >= 0
              else param.low if index == -1 else param.high for param in FAMILIES[family].params}
    return make_furniture(family=family, params=params, seed=index & 7, name=f"{family}-{index}").mesh


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("index", "edge_length", "rounds"), [(0, 0.04, 1), (0, 0.2, 1), (1, 0.06, 2)])
def test_volume_within_one_percent_and_extent_within_half(family, index, edge_length, rounds):
    mesh = furniture(family, index)
    base = rough_base(mesh, edge_length=edge_length, rounds=rounds, crease_angle=30).mesh
    assert abs(base.volume / mesh.volume - 1) < 0.01
    np.testing.assert_allclose(np.ptp(base.bounds, axis=0), np.ptp(mesh.bounds, axis=0), rtol=0.005)
    assert watertight(edges_of(mesh.faces)) and watertight(edges_of(base.faces))


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("index", [-1, -2])
def test_limits_of_the_parameters(family, index):
    mesh = furniture(family, index)
    base = rough_base(mesh, edge_length=0.1, rounds=1, crease_angle=30).mesh
    assert abs(base.volume / mesh.volume - 1) < 0.01
    np.testing.assert_allclose(np.ptp(base.bounds, axis=0), np.ptp(mesh.bounds, axis=0), rtol=0.005)
