"""What is named of a shape: loose triangles and surfaces through themselves; and what is not."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.geometry.mesh import TriangleMesh, concatenate
from dataset_builder.geometry.shape_faults import shape_faults


def loose(mesh: TriangleMesh, gap: float) -> TriangleMesh:
    """Triangles with vertices of their own, shrunk by a share `gap` about their middles."""
    corners = mesh.corners - gap * (mesh.corners - mesh.corners.mean(axis=1, keepdims=True))
    return TriangleMesh(positions=corners.reshape(-1, 3), faces=np.arange(mesh.faces.size).reshape(-1, 3),
                        uvs=mesh.uvs, material=mesh.material)


@pytest.mark.parametrize("name", ["box", "torus", "vase", "cylinder", "grid", "chamfered"])
def test_sound_shapes_have_no_faults(shapes, name):
    found = shape_faults(shapes[name]())
    assert (found.crossing, found.loose, found.notes) == (0, 0, [])


def test_parts_that_stand_in_each_other_are_no_fault(shapes):
    box = shapes["box"]()
    assert shape_faults(concatenate([box, replace(box, positions=box.positions + 0.3)])).crossing == 0


def test_a_surface_through_itself_is_counted(shapes):
    """A strip of three quads whose last goes down through its first: the fold between them does not count."""
    positions = [(0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 1, 0), (0.4, 0.3, 1), (0.4, 0.7, 1), (0.4, 0.3, -1),
                 (0.4, 0.7, -1)]
    faces = [(0, 2, 3), (0, 3, 1), (2, 4, 5), (2, 5, 3), (4, 6, 7), (4, 7, 5)]
    found = shape_faults(shapes["mesh"](positions, faces))
    # Down through z = 0 go both sides and the diagonal of the last quad; the first one's diagonal goes through the last
    assert found.crossing == 4 and found.looked_at == 13
    assert "intersects itself: 4 of 13 edges" in found.notes[0]


def test_loose_triangles_are_counted(shapes):
    torus = shapes["torus"]()
    found = shape_faults(loose(torus, 0.3))
    assert found.loose == len(torus.faces) and "falls apart into 576 loose pieces" in found.notes[0]


def test_pieces_that_almost_touch_are_loose_and_leaves_are_not(shapes):
    """Quads a thousandth apart belong together; the same far from each other are leaves."""
    grid = shapes["grid"](1)
    for step, expected in ((1.0005, 25), (1.5, 0)):
        leaves = concatenate([replace(grid, positions=grid.positions + step * np.array((i, j, 0)))
                              for i in range(5) for j in range(5)])
        assert shape_faults(leaves).loose == expected
