"""Finer meshes: edges split at their midpoints without T-junctions, and Loop subdivision with creases.

Each round of Loop subdivision is one sparse matrix. Smooth rule: C. Loop, "Smooth Subdivision Surfaces Based on
Triangles", 1987, with the vertex weights of J. Warren, "Subdivision Methods for Geometric Design", 1995, which Open3D's
`subdivide_loop` uses too. Creases: H. Hoppe et al., "Piecewise Smooth Surface Reconstruction", SIGGRAPH 1994, and
H. Biermann, A. Levin, D. Zorin, "Piecewise Smooth Subdivision Surfaces with Normal Control", SIGGRAPH 2000.
"""

import numpy as np
from scipy.sparse import coo_array, csr_array

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import Edges, consistent, curves, edges_of, fans, find_edges, unit
from dataset_builder.geometry.mesh import TriangleMesh

MAX_FACES = 4_000_000
"""Default budget: most faces of a rough mesh, about 1 GB of arrays on the way."""
EQUILATERAL = 3**0.5 / 4
ALL_SPLIT = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
"""Children of a triangle: 0 to 2 are its corners, 3 to 5 the midpoints of the edges that leave them."""
CORNER_ANGLE = 30.0
OPPOSITE = (2, 0, 1)


def split_long_edges(mesh: TriangleMesh, max_length: float, *, max_faces: int = MAX_FACES) -> TriangleMesh:
    """Conforming midpoint refinement until no edge is longer than `max_length` metres.

    Every edge that is too long is halved for all of its faces at once; a face with one, two or three halved edges
    becomes two, three or four. New corners lie on the old triangles and take linear uvs and colours: volume, extent and
    texture stay. Raises UserError if more than `max_faces` faces would be needed, or if `max_length` is not positive.
    """
    if not max_length > 0:
        raise UserError(f"edge length: expected > 0 m, got {max_length:g}")
    _check_area(mesh, max_length, max_faces)
    while True:
        edges = edges_of(mesh.faces)
        ends = mesh.positions[edges.vertices]
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > max_length
        if not long.any():
            return mesh
        _check_budget(len(mesh.faces) + int(edges.face_count[long].sum()), max_length, max_faces)
        mesh = _split(mesh, edges, long)


def _check_area(mesh: TriangleMesh, max_length: float, max_faces: int) -> None:
    """Refuse early: no triangle with such edges is larger than the equilateral one."""
    if len(mesh.faces) > max_faces:
        raise UserError(f"mesh: {len(mesh.faces):,} faces are more than the {max_faces:,} allowed before subdivision; "
                        f"lower rough.rounds, each of which makes four faces of one, {MAX_FACES:,} at most in the end, "
                        "or reduce the mesh")
    area = float(np.linalg.norm(mesh.area_normals, axis=1).sum()) / 2
    _check_budget(max(len(mesh.faces), int(area / (EQUILATERAL * max_length**2))), max_length, max_faces)


def _check_budget(needed: int, max_length: float, max_faces: int) -> None:
    if needed > max_faces:
        raise UserError(f"mesh: edges of at most {max_length:g} m need at least {needed} faces, more than the "
                        f"{max_faces} allowed; raise edge_length, or check the scale of the model")


def _split(mesh: TriangleMesh, edges: Edges, long: np.ndarray) -> TriangleMesh:
    """One round: halve the edges in the (E,) mask `long`."""
    number = len(mesh.positions) + np.cumsum(long) - 1
    midpoints = mesh.positions[edges.vertices[long]].mean(axis=1)
    six = np.concatenate([mesh.faces, number[edges.of_face]], axis=1)
    positions = np.concatenate([mesh.positions, midpoints])
    parents, slots = _children(six, long[edges.of_face], positions)
    return TriangleMesh(positions=positions, faces=six[parents[:, None], slots],
                        uvs=with_midpoints(mesh.uvs)[parents[:, None], slots], material=mesh.material[parents],
                        colors=None if mesh.colors is None else with_midpoints(mesh.colors)[parents[:, None], slots])


def with_midpoints(corners: np.ndarray) -> np.ndarray:
    """(F, 6, n) corners, then midpoints of the edges that leave them, of (F, 3, n) corner values."""
    return np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2], axis=1)


def _children(six: np.ndarray, halved: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parent face (N,) and slots (N, 3) among its six points of every face of the next round, in order of parents."""
    count = halved.sum(axis=1)
    whole = np.flatnonzero(count == 0)
    parts = [(whole, np.broadcast_to(np.arange(3), (len(whole), 3)))]
    parts += [_pattern(np.flatnonzero(count == 3), np.zeros(1, np.int64), ALL_SPLIT)]
    one = np.flatnonzero(count == 1)
    parts += [_pattern(one, halved[one].argmax(axis=1), ((0, 3, 2), (3, 1, 2)))]
    two = np.flatnonzero(count == 2)
    # Turn the face so that its whole edge is the last one; cut the quadrilateral left over along its shorter diagonal.
    turn = (~halved[two]).argmax(axis=1) + 1
    across = [_distance(positions, six, two, turn, pair) for pair in ((0, 4), (3, 2))]
    short = across[0] <= across[1]
    parts += [_pattern(two[short], turn[short], ((3, 1, 4), (0, 3, 4), (0, 4, 2)))]
    parts += [_pattern(two[~short], turn[~short], ((3, 1, 4), (0, 3, 2), (3, 4, 2)))]
    parents = np.concatenate([part[0] for part in parts])
    order = np.argsort(parents, kind="stable")
    return parents[order], np.concatenate([part[1] for part in parts])[order]


def _pattern(faces: np.ndarray, turn: np.ndarray, triangles: tuple[tuple[int, int, int], ...]) \
        -> tuple[np.ndarray, np.ndarray]:
    """Children of `faces` after `triangles`, whose slots are turned by `turn` corners."""
    slots = _turned(np.array(triangles)[None], np.broadcast_to(turn, faces.shape)[:, None, None])
    return np.repeat(faces, len(triangles)), slots.reshape(-1, 3)


def _turned(slots: np.ndarray, turn: np.ndarray) -> np.ndarray:
    return np.where(slots < 3, (slots + turn) % 3, 3 + (slots + turn) % 3)


def _distance(positions: np.ndarray, six: np.ndarray, faces: np.ndarray, turn: np.ndarray, pair: tuple[int, int]) \
        -> np.ndarray:
    one, other = (positions[six[faces, _turned(np.array(slot), turn)]] for slot in pair)
    return np.linalg.norm(one - other, axis=1)


def loop(mesh: TriangleMesh, *, rounds: int, creases: np.ndarray, corner_angle: float = CORNER_ANGLE) \
        -> tuple[TriangleMesh, np.ndarray]:
    """`rounds` rounds of Loop subdivision; each makes four faces of one.

    creases: (C, 2) vertex pairs, or an (E,) bool mask over `edges_of(mesh.faces)`; edges without two faces of the same
    orientation are creases always. A vertex on exactly two creases follows
    the crease curve, unless the curve turns there by more than `corner_angle` degrees; on one crease, on three or more,
    or where separate fans of faces touch, it stays where it is. Returns the mesh and its (C', 2) creases: the halves of
    the old ones, whatever their angle has become. Old vertices keep their numbers; uvs and colours are linear, so
    textures stay put.
    """
    edges = edges_of(mesh.faces)
    mask = (creases if creases.dtype == bool else find_edges(edges, creases)) | ~consistent(edges)
    fixed = fixed_vertices(mesh, edges, mask, corner_angle=corner_angle)
    pairs = edges.vertices[mask]
    for done in range(rounds):
        if done:
            # A sheet modelled from both sides: its sides share midpoints, so new edges have four faces
            edges = edges_of(mesh.faces)
            mask = find_edges(edges, pairs) | ~consistent(edges)
            fixed |= ~np.isin(np.bincount(edges.vertices[mask].ravel(), minlength=len(fixed)), (0, 2))
            pairs = edges.vertices[mask]
        matrix = subdivision_matrix(edges, mask, fixed)
        middle = len(mesh.positions) + np.arange(len(edges.vertices))
        pairs = np.concatenate([np.stack([edges.vertices[mask, end], middle[mask]], axis=1) for end in (0, 1)])
        mesh = _quarter(mesh, matrix @ mesh.positions, middle[edges.of_face])
        fixed = np.concatenate([fixed, np.zeros(len(middle), bool)])
    return mesh, pairs[np.lexsort(pairs.T[::-1])]


def fixed_vertices(mesh: TriangleMesh, edges: Edges, creases: np.ndarray, *, corner_angle: float) -> np.ndarray:
    """(V,) bool: corners, which subdivision leaves in place (see `loop`)."""
    count = np.bincount(edges.vertices[creases].ravel(), minlength=len(mesh.positions))
    corner_fans = fans(edges, np.ones(len(edges.vertices), bool))
    owner = np.zeros(corner_fans.max(initial=-1) + 1, np.int64)
    owner[corner_fans.ravel()] = mesh.faces.ravel()
    touching = np.bincount(owner, minlength=len(mesh.positions)) > 1
    return ((count != 0) & (count != 2)) | touching | _turning(mesh, edges, creases, corner_angle)


def _turning(mesh: TriangleMesh, edges: Edges, creases: np.ndarray, corner_angle: float) -> np.ndarray:
    """(V,) bool: two creases leave the vertex, and the way along them turns by more than `corner_angle` degrees."""
    vertices, neighbours = curves(edges, creases)
    arriving, leaving = (unit(sign * (mesh.positions[neighbours[:, side]] - mesh.positions[vertices]))
                         for side, sign in ((0, -1), (1, 1)))
    sine = np.linalg.norm(np.cross(arriving, leaving), axis=1)
    angle = np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", arriving, leaving)))
    turning = np.zeros(len(mesh.positions), bool)
    turning[vertices] = angle > corner_angle
    return turning


def subdivision_matrix(edges: Edges, creases: np.ndarray, fixed: np.ndarray) -> csr_array:
    """(V + E, V) weights of one round, rows of sum 1: first the old vertices, then one vertex per edge.

    Smooth vertex of valence n: beta for each neighbour with beta = 3/16 for n = 3, else 3/(8 n), the rest for itself.
    Crease vertex: 1/8, 3/4, 1/8. Fixed vertex: itself. Smooth edge: 3/8 for its ends, 1/8 for the two corners opposite.
    Crease edge: its midpoint. edges, creases (E,) bool and fixed (V,) bool as in `loop`.
    """
    parts = [*_vertex_weights(edges, creases, fixed), *_edge_weights(edges, creases, len(fixed))]
    rows, columns, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    return coo_array((weights, (rows, columns)), shape=(len(fixed) + len(edges.vertices), len(fixed))).tocsr()


Entries = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Rows, columns and values of some entries of a sparse matrix."""


def _vertex_weights(edges: Edges, creases: np.ndarray, fixed: np.ndarray) -> list[Entries]:
    count = len(fixed)
    valence = np.bincount(edges.vertices.ravel(), minlength=count)
    on_crease = np.bincount(edges.vertices[creases].ravel(), minlength=count) > 0
    beta = np.where(valence == 3, 3 / 16, 3 / (8 * np.maximum(valence, 1)))
    smooth = ~fixed & ~on_crease & (valence > 0)
    here = np.concatenate([edges.vertices[:, 0], edges.vertices[:, 1]])
    there = np.concatenate([edges.vertices[:, 1], edges.vertices[:, 0]])
    sharp = np.tile(creases, 2)
    share = np.where(smooth[here], beta[here], np.where(sharp & ~fixed[here], 1 / 8, 0.0))
    own = np.where(smooth, 1 - valence * beta, np.where(on_crease & ~fixed, 3 / 4, 1.0))
    some = share > 0
    return [(here[some], there[some], share[some]), (np.arange(count), np.arange(count), own)]


def _edge_weights(edges: Edges, creases: np.ndarray, vertex_count: int) -> list[Entries]:
    rows = vertex_count + np.arange(len(edges.vertices))
    end = np.where(creases, 1 / 2, 3 / 8)
    smooth = ~creases[edges.of_face]
    start = np.where(edges.forward, *(edges.vertices[edges.of_face, side] for side in (0, 1)))
    return [
        *((rows, edges.vertices[:, side], end) for side in (0, 1)),
        (rows[edges.of_face[smooth]], start[:, OPPOSITE][smooth], np.full(int(smooth.sum()), 1 / 8)),
    ]


def _quarter(mesh: TriangleMesh, positions: np.ndarray, middle: np.ndarray) -> TriangleMesh:
    """Four faces of each, given (F, 3) numbers of the vertices in the middle of the edges that leave its corners."""
    six, children = np.concatenate([mesh.faces, middle], axis=1), np.array(ALL_SPLIT)

    def quartered(corners: np.ndarray) -> np.ndarray:
        return with_midpoints(corners)[:, children].reshape(-1, 3, corners.shape[2])

    return TriangleMesh(positions=positions, faces=six[:, children].reshape(-1, 3), uvs=quartered(mesh.uvs),
                        material=np.repeat(mesh.material, len(children)),
                        colors=None if mesh.colors is None else quartered(mesh.colors))
