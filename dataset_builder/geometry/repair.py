"""Repair a mesh: weld vertices in the same place, drop faces that enclose nothing."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.mesh import TriangleMesh

FLATNESS = 1e-10
"""Least height of a triangle in units of its longest edge."""


@dataclass(frozen=True, kw_only=True)
class RepairReport:
    """What `repair` did."""

    welded: int
    """Vertices welded into others."""
    unused: int
    """Vertices used by no face."""
    degenerate: int
    """Faces without area."""
    duplicate: int
    """Faces that stood twice."""


def repair(mesh: TriangleMesh, *, tolerance: float = 1e-6) -> tuple[TriangleMesh, RepairReport]:
    """Weld vertices closer than `tolerance` (in diagonals of the bounding box; 0 welds equal positions only), then drop
    degenerate and duplicate faces and unused vertices. The faces that remain keep order, uvs, colours and material.

    Faces over the same corners that wind the other way are no duplicates: a sheet modelled from both sides encloses no
    volume, and half of it would. A face without area but with three distinct corners stays where other faces use all
    three of its edges: it stitches T-junctions shut. Raises UserError where no face is left.
    """
    places, place_of = weld(mesh.positions, tolerance=tolerance)
    faces = place_of[mesh.faces]
    flat = _degenerate(places, faces)
    twice = _repeated(faces) & ~flat
    keep = ~(flat | twice)
    if not keep.any():
        raise UserError(f"mesh: expected at least one face with an area, got {len(faces)} faces, "
                        f"{int(flat.sum())} of them degenerate; export the model with its surfaces triangulated")
    used, compact = np.unique(faces[keep], return_inverse=True)
    mended = TriangleMesh(positions=places[used], faces=compact.reshape(-1, 3), uvs=mesh.uvs[keep],
                          material=mesh.material[keep],
                          colors=None if mesh.colors is None else mesh.colors[keep])
    return mended, RepairReport(welded=len(mesh.positions) - len(places), unused=len(places) - len(used),
                                degenerate=int(flat.sum()), duplicate=int(twice.sum()))


def weld(positions: np.ndarray, *, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) places in order of first use, and (V,) the place of each of the (V, 3) positions.

    Chains of neighbours within `tolerance` bounding-box diagonals become one place, that of the first vertex.
    """
    exact, first, inverse = np.unique(positions + 0.0, axis=0, return_index=True, return_inverse=True)
    group, first = _join(exact, first, tolerance)
    rank = np.empty(len(first), np.int64)
    order = np.argsort(first, kind="stable")
    rank[order] = np.arange(len(first))
    return positions[first[order]], rank[group][inverse.ravel()]


def _join(points: np.ndarray, first: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Group of every distinct point, and the smallest original vertex of every group."""
    if not len(points) or tolerance <= 0:
        return np.arange(len(points)), first
    reach = tolerance * float(np.linalg.norm(np.ptp(points, axis=0)))
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    count, group = connected_components(graph, directed=False)
    lowest = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(lowest, group, first)
    return group, lowest


def _degenerate(places: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) bool: a repeated corner, or no area and an edge that no other face needs."""
    corners = places[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.einsum("fij,fij->fi", sides, sides).max(axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    repeated = (faces == np.roll(faces, -1, axis=1)).any(axis=1)
    flat = ~repeated & (area <= FLATNESS * longest)
    if not flat.any():
        return repeated
    edges = edges_of(faces[~repeated])
    stitch = np.zeros(len(faces), bool)
    stitch[~repeated] = (edges.face_count[edges.of_face] > 1).all(axis=1)
    return repeated | (flat & ~stitch)


def _repeated(faces: np.ndarray) -> np.ndarray:
    """(F,) bool: an earlier face has the same corners in the same cyclic order."""
    turn = faces.argmin(axis=1)[:, None] + np.arange(3)
    _, first = np.unique(np.take_along_axis(faces, turn % 3, axis=1), axis=0, return_index=True)
    again = np.ones(len(faces), bool)
    again[first] = False
    return again
