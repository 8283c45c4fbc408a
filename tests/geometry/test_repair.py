"""Welding and dropping faces."""

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.repair import repair, weld
from tests.geometry.closed import watertight


def soup(mesh, jitter=0.0):
    """The mesh with a vertex of its own for every corner, moved by up to `jitter`."""
    corners = mesh.corners.reshape(-1, 3)
    moved = corners + jitter * np.random.default_rng(0).uniform(-1, 1, corners.shape)
    return TriangleMesh(positions=moved, faces=np.arange(len(corners)).reshape(-1, 3), uvs=mesh.uvs,
                        material=np.arange(len(mesh.faces)))


@pytest.mark.parametrize("jitter", [0.0, 1e-8])
def test_a_soup_becomes_one_closed_surface(shapes, jitter):
    box = shapes["box"]()
    mended, report = repair(soup(box, jitter))
    assert len(mended.positions) == 8 and report.welded == 36 - 8
    assert watertight(edges_of(mended.faces))
    assert mended.volume == pytest.approx(1, abs=1e-6)
    np.testing.assert_array_equal(mended.uvs, box.uvs)


def test_no_tolerance_welds_equal_places_only(shapes):
    assert repair(soup(shapes["box"]()), tolerance=0)[1].welded == 28
    assert repair(soup(shapes["box"](), 1e-8), tolerance=0)[1].welded == 0


def test_welding_keeps_the_first_of_each_place_in_order():
    places, place_of = weld(np.array([[3.0, 0, 0], [1, 0, 0], [3, 0, 1e-9], [-0.0, 0, 0], [0, 0, 0]]), tolerance=1e-6)
    np.testing.assert_array_equal(places, [[3, 0, 0], [1, 0, 0], [0, 0, 0]])
    np.testing.assert_array_equal(place_of, [0, 1, 0, 2, 2])


def test_faces_without_area_and_faces_that_stand_twice_go(shapes):
    positions = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (9, 9, 9)]
    faces = [(0, 1, 2), (1, 2, 0), (2, 1, 0), (0, 0, 1), (0, 1, 3)]
    uvs = np.arange(30).reshape(5, 3, 2)
    mesh = TriangleMesh(positions=positions, faces=faces, uvs=uvs, material=[5, 6, 7, 8, 9])
    mended, report = repair(mesh)
    assert (report.degenerate, report.duplicate, report.unused) == (2, 1, 2)
    np.testing.assert_array_equal(mended.material, [5, 7])
    np.testing.assert_array_equal(mended.uvs, uvs[[0, 2]])


def test_a_flat_face_that_stitches_a_gap_stays(shapes):
    positions = [(0, 0, 0), (2, 0, 0), (1, 0, 0), (1, 1, 0), (1, -1, 0)]
    faces = [(0, 2, 3), (2, 1, 3), (0, 4, 1), (0, 1, 2)]
    mended, report = repair(shapes["mesh"](positions, faces))
    assert report.degenerate == 0 and len(mended.faces) == 4


def test_nothing_left_is_an_error(shapes):
    with pytest.raises(UserError, match="at least one face with an area, got 1 faces, 1 of them degenerate"):
        repair(shapes["mesh"]([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]))
