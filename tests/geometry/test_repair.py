"""Welding, dropping and turning faces; what repair says of it."""

import hashlib
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from dataset_builder.assets.procedural.furniture import make_furniture
from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.mesh import TriangleMesh, concatenate
from dataset_builder.geometry.repair import repair, weld
from dataset_builder.geometry.winding import turn
from dataset_builder.seeding import rng
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.numbers import draw
from tests.geometry.closed import watertight

REPAIRED = {
    "chair": "b29d0e8ddda2261c", "armchair": "0e2331936824d052", "sofa": "e80b9524e46b80a8",
    "stool": "6271eecfc7933f44", "bench": "b968e467c4d016d6", "ottoman": "27b87e54ba7cab9c",
    "dining_table": "4a79974e83d8e495", "coffee_table": "85bab5e9794fc041", "desk": "0d949cccdcec60f3",
    "cabinet": "0f77d3600e90d8fd", "bookshelf": "fed8689d5116c1cd", "wardrobe": "9ea0c611068bec40",
    "nightstand": "791ef1e66cf57b98", "bed": "3d821d8e1657e595", "floor_lamp": "8ef7f5db32b8d0af",
    "vase": "6df12a00fc0c1de6", "plant": "c731772349c06880",
}
"""SHA-256, first half, of the faces and materials of furniture whose faces shared no vertices: as they were when repair
turned nothing."""


def turned(mesh, *numbers):
    """The mesh with some faces wound the other way."""
    return turn(mesh, np.isin(np.arange(len(mesh.faces)), numbers))


def moved(mesh, scale=1.0, offset=(0.0, 0, 0)):
    return replace(mesh, positions=scale * mesh.positions + np.array(offset))


@lru_cache(maxsize=1)
def furniture(family):
    params = {param.name: draw(param.default, rng(0, family, param.name)) for param in FAMILIES[family].params}
    return make_furniture(family=family, params=params, seed=0, name=family).mesh


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


# Winding

@pytest.mark.parametrize("family", FAMILIES)
def test_embedded_furniture_stays_as_it_is(family):
    mesh = furniture(family)
    loose = replace(soup(mesh), material=mesh.material)
    mended, report = repair(loose)
    assert (report.turned, report.inside_out, report.one_sided) == (0, 0, 0) and report.closed == report.pieces
    assert hashlib.sha256(mended.faces.tobytes() + mended.material.tobytes()).hexdigest()[:16] == REPAIRED[family]


def test_a_face_wound_against_its_neighbours_is_turned_with_its_corners(shapes):
    box = shapes["box"]()
    colors = np.random.default_rng(0).random((12, 3, 4)).astype(np.float32)
    mended, report = repair(turned(replace(box, colors=colors), 3, 8))
    assert (report.turned, report.inside_out, report.closed) == (2, 0, 1)
    for name in ("faces", "uvs", "colors", "positions"):
        np.testing.assert_array_equal(getattr(mended, name), getattr(replace(box, colors=colors), name))


def test_a_closed_piece_inside_out_is_turned_outwards(shapes):
    """One box of two, and two faces of it besides: it was wound alike but for those, and inwards."""
    box = shapes["box"]()
    inwards = turned(box, *(set(range(12)) - {3, 8}))
    mended, report = repair(concatenate([box, moved(inwards, offset=(3, 0, 0))]), part=np.repeat([0, 1], 12))
    assert (report.turned, report.inside_out, report.pieces, report.closed) == (2, 1, 2, 2)
    assert mended.volume == pytest.approx(2) and watertight(edges_of(mended.faces))
    assert [(part.turned, part.inside_out, part.pieces) for part in report.parts] == [(0, 0, 1), (2, 1, 1)]


def test_a_cavity_stays_a_cavity(shapes):
    """The inner wall of a hollow cube looks inwards and should; beside the cube, it would be inside out."""
    box = shapes["box"]()
    inner = turned(moved(box, 0.5), *range(12))
    hollow, report = repair(concatenate([box, inner]))
    assert report.inside_out == 0 and report.closed == 2 and hollow.volume == pytest.approx(1 - 0.125)
    beside, report = repair(concatenate([box, moved(inner, offset=(2, 0, 0))]))
    assert report.inside_out == 1 and beside.volume == pytest.approx(1 + 0.125)


def test_open_surfaces_and_sheets_with_two_sides_have_no_outside(shapes):
    grid = shapes["grid"](4)
    down = turned(grid, *range(32))
    assert repair(down)[1].inside_out == 0 and repair(down)[1].closed == 0
    np.testing.assert_array_equal(repair(down)[0].faces, down.faces)
    sheet, report = repair(concatenate([grid, down]))
    assert (report.turned, report.inside_out, report.duplicate) == (0, 0, 0) and len(sheet.faces) == 64


def test_most_faces_win_and_of_equally_many_the_first(shapes):
    grid = shapes["grid"](1)
    np.testing.assert_array_equal(repair(turned(grid, 1))[0].faces, grid.faces)
    np.testing.assert_array_equal(repair(turned(grid, 0))[0].faces, turned(grid, 0, 1).faces)
    four = shapes["grid"](2)
    np.testing.assert_array_equal(repair(turned(four, 0, 1, 2, 3, 4))[0].faces, turned(four, *range(8)).faces)


def test_a_moebius_strip_is_left_and_said(shapes):
    angle = 2 * np.pi * np.arange(24) / 24
    across = np.stack([np.cos(angle) * np.cos(angle / 2), np.sin(angle) * np.cos(angle / 2), np.sin(angle / 2)], axis=1)
    middle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    rims = np.concatenate([middle - 0.2 * across, middle + 0.2 * across])
    here, ahead = np.arange(24), (np.arange(24) + 1) % 24
    # After one turn the lower rim goes on as the upper one
    low, high = np.where(ahead == 0, 24, ahead), np.where(ahead == 0, 0, ahead + 24)
    strip = shapes["mesh"](rims, np.concatenate([np.stack([here, low, high], 1), np.stack([here, high, here + 24], 1)]))
    mended, report = repair(strip)
    assert (report.one_sided, report.turned, report.pieces) == (1, 0, 1)
    np.testing.assert_array_equal(mended.faces, strip.faces)


def test_each_part_has_its_own_report(shapes):
    """Two boxes without shared vertices, the second with a flat face and a face that stands twice; nothing is welded
    twice: the sum over parts is the whole."""
    box = shapes["box"]()
    worse = shapes["mesh"](box.positions, np.concatenate([box.faces, box.faces[:1], [[0, 0, 1]]]))
    one, other = soup(box), soup(moved(worse, offset=(1, 0, 0)))
    _, report = repair(concatenate([one, other]), part=np.repeat([0, 1], [12, 14]))
    first, second = report.parts
    assert (first.degenerate, first.duplicate, second.degenerate, second.duplicate) == (0, 0, 1, 1)
    # The boxes touch: the four corners where they do are the first one's
    assert (first.welded, second.welded) == (36 - 8, 42 - 4) and report.welded == 28 + 38
    assert report.pieces == first.pieces + second.pieces == 1


def test_vertices_that_crowd_are_refused(shapes):
    """A stray vertex makes a million times the model's extent: all of it would become one place."""
    grid = shapes["grid"](40)
    stray = replace(grid, positions=np.concatenate([grid.positions, [[1e8, 0, 0]]]))
    with pytest.raises(UserError, match=r"vertices further apart than 100 m.*remove what stands far from the model"):
        repair(stray)
