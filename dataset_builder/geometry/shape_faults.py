"""What is wrong with a shape and cannot be mended without changing it: loose triangles, surfaces through themselves."""

from dataclasses import dataclass

import numpy as np

from dataset_builder.geometry.edges import Edges, edges_of
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.geometry.repair import weld
from dataset_builder.geometry.winding import pieces

LOOKED_AT = 20_000
"""Edges that are tested, evenly chosen where there are more."""
ENDS = 0.01
"""Share of an edge at either end where touching does not count."""
GRAZING = 0.05
"""Sine of the angle below which an edge lies in a face rather than passes through it."""
SHORT = 1e-4
"""Length of an edge, in diagonals of the bounding box, below which single precision cannot tell."""
LOOSE, FEW = 4.0, 16
"""Mean faces of a piece below which, and pieces from which on, a mesh may fall apart."""
NEAR = 1e-3
"""Diagonals of the bounding box within which vertices of pieces that belong together lie."""


@dataclass(frozen=True, kw_only=True)
class ShapeFaults:
    """What is named and left as it is."""

    crossing: int
    """Of `looked_at` edges, how many pass through their own piece."""
    looked_at: int
    loose: int
    """Pieces that a mesh falls apart into: single triangles, or pieces of few that touch without sharing vertices."""

    @property
    def notes(self) -> list[str]:
        """One sentence for each."""
        found = []
        if self.loose:
            found.append(f"falls apart into {self.loose:,} loose pieces of few triangles, between which noise opens "
                         "cracks; export it with shared vertices")
        if self.crossing:
            found.append(f"intersects itself: {self.crossing:,} of {self.looked_at:,} edges looked at pass through "
                         "the piece they belong to")
        return found


def shape_faults(mesh: TriangleMesh) -> ShapeFaults:
    """Look for them in a mesh that was repaired. Parts that stand in each other, as those of furniture do, are no
    fault."""
    edges = edges_of(mesh.faces)
    piece = pieces(edges)
    crossing, looked_at = _crossing(mesh, edges, piece)
    return ShapeFaults(crossing=crossing, looked_at=looked_at, loose=_loose(mesh, piece))


def _crossing(mesh: TriangleMesh, edges: Edges, piece: np.ndarray) -> tuple[int, int]:
    low, high = mesh.bounds
    positions = (mesh.positions - (low + high) / 2) / float(np.linalg.norm(high - low))
    chosen = np.arange(0, len(edges.vertices), -(-len(edges.vertices) // LOOKED_AT))
    start, end = (positions[edges.vertices[chosen, side]] for side in (0, 1))
    long = np.linalg.norm(end - start, axis=1) > SHORT
    chosen, start, along = chosen[long], start[long], (end - start)[long]
    ray, face, share = RayScene([(positions, mesh.faces, 1)]).hits(start, along)
    inside = (share > ENDS) & (share < 1 - ENDS)
    ray, face = ray[inside], face[inside]
    vertices, own = mesh.faces[face], edges.vertices[chosen[ray]]
    apart = (vertices[:, :, None] != own[:, None, :]).all(axis=(1, 2)) & (
        piece[face] == piece[edges.faces[chosen[ray], 0]])
    a, b, c = np.moveaxis(positions[vertices], 1, 0)
    normal, way = np.cross(b - a, c - a), along[ray]
    sine = np.abs(np.einsum("ij,ij->i", normal, way))
    through = sine > GRAZING * np.linalg.norm(normal, axis=1) * np.linalg.norm(way, axis=1)
    return len(np.unique(ray[apart & through])), len(chosen)


def _loose(mesh: TriangleMesh, piece: np.ndarray) -> int:
    count = int(piece.max()) + 1
    if count < FEW or len(piece) >= LOOSE * count:
        return 0
    if len(piece) == count:
        return count
    _, place = weld(mesh.positions, tolerance=NEAR)
    faces = place[mesh.faces]
    whole = faces[(faces != np.roll(faces, -1, axis=1)).all(axis=1)]
    return count if not len(whole) or 2 * (1 + pieces(edges_of(whole)).max()) < count else 0
