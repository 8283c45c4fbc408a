"""The rough base keeps the shape of the clean mesh."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import crease_mask, edges_of
from dataset_builder.geometry.loop import loop
from dataset_builder.geometry.noise import displace
from dataset_builder.geometry.rough_base import rough_base
from tests.geometry.closed import watertight

SOLIDS = [("box", {}), ("box", {"size": (0.04, 0.05, 0.9)}), ("chamfered", {}),
          ("chamfered", {"size": 0.3, "chamfer": 0.01}), ("cylinder", {}),
          ("cylinder", {"radius": 0.02, "height": 0.7}), ("cylinder", {"sides": 64}), ("vase", {}),
          ("vase", {"sides": 64})]


@pytest.mark.parametrize(("name", "how"), SOLIDS)
@pytest.mark.parametrize("rounds", [0, 1, 2])
def test_volume_within_one_percent_and_extent_within_half(shapes, name, how, rounds):
    mesh = shapes[name](**how)
    rough = rough_base(mesh, edge_length=0.05, rounds=rounds, crease_angle=30).mesh
    assert abs(rough.volume / mesh.volume - 1) < 0.01
    np.testing.assert_allclose(np.ptp(rough.bounds, axis=0), np.ptp(mesh.bounds, axis=0), rtol=0.005)
    ends = rough.positions[edges_of(rough.faces).vertices]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max() < 0.05 * 1.5


@pytest.mark.parametrize("sides", [16, 32])
@pytest.mark.parametrize("rounds", [1, 2, 3])
def test_balance_takes_out_most_of_what_plain_loop_shrinks(shapes, sides, rounds):
    mesh = shapes["cylinder"](sides=sides)
    edges = edges_of(mesh.faces)
    plain, _ = loop(mesh, rounds=rounds, creases=crease_mask(mesh, edges, crease_angle=30))
    rough = rough_base(mesh, edge_length=1, rounds=rounds, crease_angle=30).mesh
    assert len(plain.faces) == len(rough.faces)
    assert plain.volume / mesh.volume < 1 - 0.07 * (16 / sides) ** 2 / 4
    assert abs(rough.volume / mesh.volume - 1) < 0.3 * (1 - plain.volume / mesh.volume)


def test_balance_leaves_flat_sides_flat_and_within_their_outline(shapes):
    mesh = shapes["box"]((1.0, 0.02, 0.3))
    rough = rough_base(mesh, edge_length=0.03, rounds=2, crease_angle=30).mesh
    np.testing.assert_allclose(rough.bounds, mesh.bounds, atol=1e-12)
    area = np.linalg.norm(mesh.area_normals, axis=1).sum()
    assert np.linalg.norm(rough.area_normals, axis=1).sum() == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize("rounds", [1, 2])
def test_a_cube_stays_exactly_a_cube(shapes, rounds):
    rough = rough_base(shapes["box"](), edge_length=0.1, rounds=rounds, crease_angle=30).mesh
    assert rough.volume == pytest.approx(1, abs=1e-12)
    assert np.abs(np.abs(rough.positions).max(axis=1) - 0.5).max() < 1e-14


@pytest.mark.parametrize("name", ["box", "chamfered", "cylinder", "vase", "torus"])
@pytest.mark.parametrize("direction", ["isotropic", "normal"])
def test_no_crack_opens(shapes, name, direction):
    base = rough_base(shapes[name](), edge_length=0.1, rounds=1, crease_angle=30)
    noisy = displace(base.mesh, sigma=0.01, radius=0.5, direction=direction, rng=np.random.default_rng(1))
    assert watertight(edges_of(noisy.faces))
    assert len(np.unique(noisy.positions, axis=0)) == len(noisy.positions)
    outside = noisy.volume
    shifted = noisy.positions + np.array((10, -20, 30))
    assert replace(noisy, positions=shifted).volume == pytest.approx(outside, rel=1e-8)


def test_wrong_numbers_are_named(shapes):
    with pytest.raises(UserError, match="rounds: expected >= 0, got -1"):
        rough_base(shapes["box"](), edge_length=0.1, rounds=-1, crease_angle=30)
    with pytest.raises(UserError, match="more than the 31 allowed"):
        rough_base(shapes["box"](), edge_length=0.1, rounds=1, crease_angle=30, max_faces=127)
