"""Repair a mesh: weld vertices in the same place, drop faces that enclose nothing, wind the others outwards."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.winding import Winding, turn, winding_of

FLATNESS = 1e-10
"""Least height of a triangle in units of its longest edge."""
PROBES, CROWD = 256, 1000
"""Vertices whose neighbours are counted before all are looked for, and mean neighbours that are too many to join: the
pairs of a model that is a dot beside its extent would not fit into memory."""


@dataclass(frozen=True, kw_only=True)
class PartRepair:
    """What `repair` did to one part of a mesh."""

    welded: int
    """Vertices welded into others."""
    degenerate: int
    """Faces without area, dropped."""
    duplicate: int
    """Faces that stood twice, dropped."""
    turned: int
    """Faces wound against their neighbours, turned."""
    inside_out: int
    """Closed pieces that enclosed a negative volume, turned outwards."""
    pieces: int
    """Pieces kept apart: no edge of one is an edge of another."""
    closed: int
    """Of these, how many enclose a volume."""


@dataclass(frozen=True, kw_only=True)
class RepairReport(PartRepair):
    """What `repair` did to a mesh as a whole."""

    unused: int
    """Vertices used by no face, dropped."""
    one_sided: int
    """Pieces that cannot be wound consistently, like a Moebius strip; left as they are."""
    parts: tuple[PartRepair, ...]
    """The same for each part; a piece counts for the part of its first face."""


def repair(mesh: TriangleMesh, *, tolerance: float = 1e-6, part: np.ndarray | None = None,
           outwards: bool = True) -> tuple[TriangleMesh, RepairReport]:
    """Weld vertices closer than `tolerance` (in diagonals of the bounding box; 0 welds equal positions only), then drop
    degenerate and duplicate faces and unused vertices, wind the faces of every piece alike, and closed pieces outwards
    (outwards: false leaves them as they are). The faces that remain keep order, uvs, colours and material. part: (F,)
    part of each face, for the report.

    Faces over the same corners that wind the other way are no duplicates: a sheet modelled from both sides encloses no
    volume, and half of it would. A face without area but with three distinct corners stays where other faces use all
    three of its edges: it stitches T-junctions shut. A closed piece inside out that lies within another one is that
    one's cavity and stays. Raises UserError where no face is left, or where so many vertices are within the tolerance
    that the model would shrink to nothing.
    """
    part = np.zeros(len(mesh.faces), np.int64) if part is None else part
    places, place_of = weld(mesh.positions, tolerance=tolerance)
    faces = place_of[mesh.faces]
    flat = _degenerate(places, faces)
    twice = _repeated(faces) & ~flat
    keep = ~(flat | twice)
    if not keep.any():
        raise UserError(f"mesh: expected at least one face with an area, got {len(faces)} faces, "
                        f"{int(flat.sum())} of them degenerate; export the model with its surfaces triangulated")
    used, compact = _compacted(faces[keep], len(places))
    mended = TriangleMesh(positions=places[used], faces=compact, uvs=mesh.uvs[keep], material=mesh.material[keep],
                          colors=None if mesh.colors is None else mesh.colors[keep])
    winding = winding_of(mended, edges_of(mended.faces))
    if not outwards:
        winding = replace(winding, inside_out=np.zeros_like(winding.inside_out))
    counts = _counts(part, keep, winding, {"degenerate": flat, "duplicate": twice})
    counts["welded"] = _welded(mesh.faces, place_of, part, len(counts["pieces"]))
    parts = tuple(PartRepair(**dict(zip(counts, map(int, row), strict=True)))
                  for row in zip(*counts.values(), strict=True))
    return turn(mended, winding.turned), RepairReport(
        **{name: int(count.sum()) for name, count in counts.items() if name != "welded"},
        welded=len(mesh.positions) - len(places), unused=len(places) - len(used), one_sided=winding.one_sided,
        parts=parts)


def _counts(part: np.ndarray, keep: np.ndarray, winding: Winding, dropped: dict[str, np.ndarray]) \
        -> dict[str, np.ndarray]:
    """(parts,) counts by name."""
    size = int(part.max()) + 1
    owner = part[keep][np.unique(winding.piece, return_index=True)[1]]
    found = {name: np.bincount(part[mask], minlength=size) for name, mask in dropped.items()}
    found["turned"] = np.bincount(part[keep][winding.against], minlength=size)
    return found | {"inside_out": np.bincount(owner[winding.inside_out], minlength=size),
                    "pieces": np.bincount(owner, minlength=size),
                    "closed": np.bincount(owner[winding.closed], minlength=size)}


def _welded(faces: np.ndarray, place_of: np.ndarray, part: np.ndarray, size: int) -> np.ndarray:
    """(parts,) vertices that are not the first in their place, by the part that uses them."""
    earlier = np.concatenate([[-1], np.maximum.accumulate(place_of)[:-1]])
    user = np.full(len(place_of), -1)
    user[faces] = part[:, None]
    return np.bincount(user[(place_of <= earlier) & (user >= 0)], minlength=size)


def _compacted(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the vertices that (F, 3) faces use, ascending, and the faces in terms of their ranks."""
    there = np.zeros(count, bool)
    there[faces] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[faces]


def weld(positions: np.ndarray, *, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) places in order of first use, and (V,) the place of each of the (V, 3) positions.

    Chains of neighbours within `tolerance` bounding-box diagonals become one place, that of the first vertex. Raises
    UserError where vertices crowd, see `CROWD`.
    """
    first, inverse = _distinct(positions + 0.0)
    group, first = _join(positions[first], first, tolerance)
    rank = np.empty(len(first), np.int64)
    order = np.argsort(first, kind="stable")
    rank[order] = np.arange(len(first))
    return positions[first[order]], rank[group][inverse]


def _distinct(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First index of every distinct row of (N, n) values, and (N,) which of them each row is. As `np.unique` along an
    axis does, in a fifth of the time."""
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    new = np.ones(len(rows), bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    inverse = np.empty(len(rows), np.int64)
    inverse[order] = np.cumsum(new) - 1
    return order[new], inverse


def _join(points: np.ndarray, first: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Group of every distinct point, and the smallest original vertex of every group."""
    if not len(points) or tolerance <= 0:
        return np.arange(len(points)), first
    reach = tolerance * float(np.linalg.norm(np.ptp(points, axis=0)))
    tree = cKDTree(points)
    some = points[::-(-len(points) // PROBES)]
    if len(points) > CROWD and (near := tree.query_ball_point(some, reach, return_length=True).mean()) > CROWD:
        raise UserError(f"mesh: expected vertices further apart than {reach:.3g} m, a millionth of its extent, got "
                        f"{near:.0f} that close together on average; remove what stands far from the model")
    pairs = tree.query_pairs(reach, output_type="ndarray")
    if not len(pairs):
        return np.arange(len(points)), first
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
    first, _ = _distinct(np.take_along_axis(faces, turn % 3, axis=1))
    again = np.ones(len(faces), bool)
    again[first] = False
    return again
