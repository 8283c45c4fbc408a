"""Subdivision surfaces: a control cage of polygons refined by Catmull-Clark, Loop or bilinear rules.

E. Catmull, J. Clark, "Recursively Generated B-Spline Surfaces on Arbitrary Topological Meshes", 1978; C. Loop, "Smooth
Subdivision Surfaces Based on Triangles", 1987; semi-sharp creases and boundaries as OpenSubdiv has them
(https://graphics.pixar.com/opensubdiv/docs/subdivision_surfaces.html), after T. DeRose, M. Kass, T. Truong,
"Subdivision Surfaces in Character Animation", SIGGRAPH 1998.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.sparse import coo_array, csr_array

Scheme = Literal["catmullClark", "loop", "bilinear"]
Boundary = Literal["none", "edgeOnly", "edgeAndCorner"]
SHARPEST = 10.0
"""A sharpness from which on a crease stays sharp however often it is refined."""
QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
"""Children of a triangle: 0 to 2 are its corners, 3 to 5 the midpoints of the edges that leave them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cage:
    """Polygons over V vertices, C corners in F faces, and where they are sharp."""

    vertices: int
    indices: np.ndarray
    """(C,) vertices of all corners, face by face."""
    counts: np.ndarray
    """(F,) corners of each face, at least 3."""
    creases: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    """(K, 2) pairs of vertices; pairs that no edge joins count for nothing."""
    crease_sharpness: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(K,) number of rounds that a crease stays sharp; `SHARPEST` for ever."""
    corner_sharpness: np.ndarray | None = None
    """(V,) the same of vertices; None for none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Round:
    """One round of refinement: V' vertices of V, four corners or more of each."""

    scheme: Scheme
    cage: Cage
    """What it comes to."""
    counts: np.ndarray
    """(F,) corners of each face before."""
    parent: np.ndarray
    """(F',) face that each new face is from."""
    of_vertices: csr_array
    """(V', V) weights of the old vertices."""
    of_faces: csr_array
    """(V', F) weights of the old faces' centres."""
    centres: csr_array
    """(F, V) the means of the vertices of each face."""

    def vertex_values(self, values: np.ndarray) -> np.ndarray:
        """(V', N) what smooth (V, N) values at vertices become: positions, and all that is to follow them."""
        return self.of_vertices @ values + self.of_faces @ (self.centres @ values)

    def corner_values(self, values: np.ndarray) -> np.ndarray:
        """(C', N) what (C, N) values at corners become, linear within each face."""
        if self.scheme == "loop":
            three = values.reshape(-1, 3, values.shape[1])
            six = np.concatenate([three, (three + np.roll(three, -1, axis=1)) / 2], axis=1)
            return six[:, QUARTERS].reshape(-1, values.shape[1])
        after, before, face = _neighbours(self.counts)
        sums = np.add.reduceat(values, np.cumsum(self.counts) - self.counts, axis=0) if len(values) else values
        means = (sums / self.counts[:, None])[face]
        four = [values, (values + values[after]) / 2, means, (values + values[before]) / 2]
        return np.stack(four, axis=1).reshape(-1, values.shape[1])


def refinement(cage: Cage, scheme: Scheme, *, rounds: int, boundary: Boundary = "edgeAndCorner") -> tuple[Round, ...]:
    """The rounds, one after another; Catmull-Clark and bilinear make a quadrilateral of each corner, Loop four
    triangles of each.

    boundary: whether vertices with one face stay where they are (`edgeAndCorner`) or not; edges without two faces are
    sharp. For `none`, faces at such edges are no part of the surface: `at_boundary` finds them. Raises ValueError for
    Loop rules on other faces than triangles.
    """
    if scheme == "loop" and rounds and (cage.counts != 3).any():
        raise ValueError("expected triangles alone")
    found: list[Round] = []
    for number in range(rounds):
        cage = found[-1].cage if found else cage
        found.append(_refined(cage, scheme, pinned=number == 0 and boundary == "edgeAndCorner"))
    return tuple(found)


def at_boundary(cage: Cage) -> np.ndarray:
    """(F,) bool: faces that have a vertex on an edge without two faces."""
    edges = _edges(cage)
    outer = np.zeros(cage.vertices, bool)
    outer[edges.ends[edges.faces != 2].ravel()] = True
    return np.bincount(_neighbours(cage.counts)[2], outer[cage.indices], len(cage.counts)) > 0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Edges:
    ends: np.ndarray
    """(E, 2)."""
    of_corner: np.ndarray
    """(C,) the edge that leaves each corner."""
    faces: np.ndarray
    """(E,) number of faces."""
    sharp: np.ndarray
    """(E,) sharpness."""


def _neighbours(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(C,) corner after, corner before and face of every corner."""
    face = np.repeat(np.arange(len(counts)), counts)
    first = (np.cumsum(counts) - counts)[face]
    place = np.arange(len(face)) - first
    return first + (place + 1) % counts[face], first + (place - 1) % counts[face], face


def _edges(cage: Cage) -> _Edges:
    def key(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return np.minimum(one, other) * np.int64(cage.vertices) + np.maximum(one, other)

    after, _, _ = _neighbours(cage.counts)
    keys, of_corner, faces = np.unique(key(cage.indices, cage.indices[after]), return_inverse=True, return_counts=True)
    ends = np.stack([keys // max(cage.vertices, 1), keys % max(cage.vertices, 1)], axis=1)
    sharp = np.zeros(len(keys))
    if len(cage.creases) and len(keys):
        wanted = key(cage.creases[:, 0], cage.creases[:, 1])
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        there = keys[at] == wanted
        np.maximum.at(sharp, at[there], cage.crease_sharpness[there])
    sharp[faces != 2] = SHARPEST
    return _Edges(ends=ends, of_corner=of_corner, faces=faces, sharp=sharp)


def _duller(sharpness: np.ndarray) -> np.ndarray:
    """What is left of sharpness after a round."""
    return np.where(sharpness >= SHARPEST, SHARPEST, np.maximum(sharpness - 1, 0))


def _refined(cage: Cage, scheme: Scheme, *, pinned: bool) -> Round:
    edges = _edges(cage)
    _, before, face = _neighbours(cage.counts)
    vertices, many, count = cage.vertices, len(edges.ends), len(cage.counts)
    corner = np.zeros(vertices) if cage.corner_sharpness is None else cage.corner_sharpness
    if pinned:
        outer = np.zeros(vertices, bool)
        outer[edges.ends[edges.faces != 2].ravel()] = True
        corner = np.where(outer & (np.bincount(cage.indices, minlength=vertices) == 1), SHARPEST, corner)
    if scheme == "loop":
        indices = np.concatenate([cage.indices.reshape(-1, 3), vertices + edges.of_corner.reshape(-1, 3)],
                                 axis=1)[:, QUARTERS].reshape(-1)
        counts, parent = np.full(4 * count, 3), np.repeat(np.arange(count), 4)
        total = vertices + many
    else:
        indices = np.stack([cage.indices, vertices + edges.of_corner, vertices + many + face,
                            vertices + edges.of_corner[before]], axis=1).reshape(-1)
        counts, parent, total = np.full(len(cage.indices), 4), face, vertices + many + count
    of_vertices, of_faces = _weights(cage, scheme, edges, corner, total)
    middle = vertices + np.arange(many)
    dull = _duller(edges.sharp)
    creased = dull > 0
    halves = np.concatenate([np.stack([edges.ends[creased, side], middle[creased]], axis=1) for side in (0, 1)])
    finer = Cage(vertices=total, indices=indices, counts=counts, creases=halves,
                 crease_sharpness=np.tile(dull[creased], 2),
                 corner_sharpness=np.concatenate([_duller(corner), np.zeros(total - vertices)]))
    centres = coo_array((1 / cage.counts[face], (face, cage.indices)), shape=(count, vertices)).tocsr()
    return Round(scheme=scheme, cage=finer, counts=cage.counts, parent=parent, of_vertices=of_vertices,
                 of_faces=of_faces, centres=centres)


def _weights(cage: Cage, scheme: Scheme, edges: _Edges, corner: np.ndarray, total: int) -> tuple[csr_array, csr_array]:
    """(V', V) and (V', F) weights: of old vertices, then of edges, then of faces, which are their centres."""
    vertices, many, count = cage.vertices, len(edges.ends), len(cage.counts)
    face = _neighbours(cage.counts)[2]
    kept, rows = np.arange(vertices), vertices + np.arange(many)
    centres = vertices + many + np.arange(count if scheme != "loop" else 0)
    straight = np.ones(many) if scheme == "bilinear" else np.clip(edges.sharp, 0, 1)
    end, side = {"loop": (3 / 8, 1 / 8)}.get(scheme, (1 / 4, 1 / 4))
    at_end = straight / 2 + (1 - straight) * end
    inner = [(rows, edges.ends[:, 0], at_end), (rows, edges.ends[:, 1], at_end)]
    outer = [(centres, np.arange(len(centres)), np.ones(len(centres)))]
    beside = ((1 - straight) * side)[edges.of_corner]
    if scheme == "loop":
        opposite = np.roll(cage.indices.reshape(-1, 3), -2, axis=1).reshape(-1)
        inner.append((rows[edges.of_corner], opposite, beside))
    else:
        outer.append((rows[edges.of_corner], face, beside))
    if scheme == "bilinear":
        inner.append((kept, kept, np.ones(vertices)))
    else:
        own, along, around = _vertex_weights(cage, scheme, edges, corner)
        inner.append((kept, kept, own))
        inner += [(edges.ends[:, here], edges.ends[:, 1 - here], along[:, here]) for here in (0, 1)]
        outer.append((cage.indices, face, around[cage.indices]))
    return _sparse(inner, (total, vertices)), _sparse(outer, (total, count))


def _vertex_weights(cage: Cage, scheme: Scheme, edges: _Edges, corner: np.ndarray) \
        -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(V,) of a vertex itself, (E, 2) of what is along each edge from either end, and (V,) of each face around it.

    Between what holds now and what holds after this round, by how much is left of sharpness that ends in it.
    """
    def at_ends(values: np.ndarray) -> np.ndarray:
        return np.bincount(edges.ends.ravel(), np.repeat(values, 2), cage.vertices)

    def masks(sharp: np.ndarray, pinned: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        creases = at_ends(sharp.astype(float))
        fixed = pinned | (creases > 2) | (valence == 0)
        creased = ~fixed & (creases == 2)
        own = np.where(fixed, 1, np.where(creased, 3 / 4, smooth_own))
        along = np.where((fixed | creased)[edges.ends], np.where(creased[edges.ends] & sharp[:, None], 1 / 8, 0),
                         smooth_along[edges.ends])
        return own, along, np.where(fixed | creased, 0, smooth_around)

    valence = at_ends(np.ones(len(edges.ends)))
    n = np.maximum(valence, 1)
    if scheme == "loop":
        smooth_along = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / n) / 4) ** 2) / n
        smooth_around, smooth_own = np.zeros(cage.vertices), 1 - n * smooth_along
    else:
        smooth_along = smooth_around = 1 / n**2
        smooth_own = (n - 2) / n
    ending, going = (edges.sharp > 0) & (_duller(edges.sharp) == 0), (corner > 0) & (_duller(corner) == 0)
    ends = at_ends(ending.astype(float)) + going
    left = at_ends(np.where(ending, edges.sharp, 0)) + np.where(going, corner, 0)
    share = np.clip(left / np.maximum(ends, 1), 0, 1)
    now, then = masks(edges.sharp > 0, corner > 0), masks(_duller(edges.sharp) > 0, _duller(corner) > 0)
    weights = (share, share[edges.ends], share)
    own, along, around = (w * one + (1 - w) * other for w, one, other in zip(weights, now, then, strict=True))
    return own, along, around


Entries = tuple[np.ndarray, np.ndarray, np.ndarray]


def _sparse(parts: list[Entries], shape: tuple[int, int]) -> csr_array:
    rows, columns, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    some = weights != 0
    return coo_array((weights[some], (rows[some], columns[some])), shape=shape).tocsr()
