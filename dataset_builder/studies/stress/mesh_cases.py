"""Meshes that are hard to subdivide, shade or repair; nothing is rendered."""

import math

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from dataset_builder.geometry.edges import corner_normals, edges_of
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.repair import repair
from dataset_builder.geometry.rough_base import rough_base
from dataset_builder.geometry.subdivision import loop
from dataset_builder.studies.stress.case import Case, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.scenes import ball_mesh, bare, box_mesh

ROUNDS = 3
OUTSIDE = "farthest vertex outside the control mesh's hull, relative to its size"


def smooth(mesh: TriangleMesh) -> TriangleMesh:
    """Three rounds of Loop subdivision without creases of choice."""
    return loop(mesh, rounds=ROUNDS, creases=np.zeros((0, 2), int))[0]


def outside_hull(mesh: TriangleMesh, control: TriangleMesh) -> float:
    """How far the mesh sticks out of the convex hull of its control mesh, in diagonals of the bounding box; where that
    is flat, out of the bounding box. All weights of Loop subdivision are positive, so it never does."""
    diagonal = float(np.linalg.norm(np.ptp(control.positions, axis=0)))
    low, high = control.bounds
    beyond = max(float((low - mesh.positions).max()), float((mesh.positions - high).max()))
    try:
        planes = ConvexHull(control.positions).equations
    except QhullError:
        return max(0.0, beyond) / diagonal
    return max(0.0, float((mesh.positions @ planes[:, :3].T + planes[:, 3]).max())) / diagonal


def sound(mesh: TriangleMesh) -> list[str]:
    """What is wrong with a mesh or its normals: values that are not finite, normals that are no unit vectors."""
    normals = corner_normals(mesh)
    wrong = [] if np.isfinite(mesh.positions).all() else ["positions: expected finite values"]
    off = np.abs(np.linalg.norm(normals, axis=2) - 1).max()
    return [*wrong, *([] if off < 1e-6 else [f"normals: expected length 1, got it off by {off:g}"])]


def bipyramid(valence: int) -> TriangleMesh:
    """Two apices of this valence over a ring of valence 4; it encloses n sin(2 pi / n) / 3."""
    angle = 2 * math.pi * np.arange(valence) / valence
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(valence)], axis=1)
    after = (np.arange(valence) + 1) % valence
    top, bottom = valence, valence + 1
    faces = [(i, j, top) for i, j in enumerate(after.tolist())] + [(j, i, bottom) for i, j in enumerate(after.tolist())]
    return bare(np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]), faces)


def bounded(control: TriangleMesh, *, least: float) -> CaseMeasured:
    """Subdivide a closed mesh; the result is sound, inside the hull, closed, and keeps a share of its volume."""
    mesh = smooth(control)
    share = mesh.volume / control.volume
    wrong = sound(mesh) + ([] if least <= share <= 1 else [f"volume: expected {least:g} to 1 times, got {share:g}"])
    wrong += [] if (edges_of(mesh.faces).face_count == 2).all() else ["edges: expected two faces at each"]
    return CaseMeasured(figure=outside_hull(mesh, control), wrong=tuple(wrong))


@hard_case(name="mesh/loop-valence-2", bound=1e-12, figure=OUTSIDE,
           expectation="a triangle modelled from both sides, its corners of valence 2, stays within itself",
           failure="vertices that fly off, or NaN: the weight of a neighbour assumes three of them")
def valence_two(size: Size) -> CaseMeasured:
    """Encloses nothing, before and after. Its sides share midpoints, so that edges with four faces appear."""
    control = bare(np.array([[5, 5, 5], [6, 5, 5], [5, 6, 5]]), [[0, 1, 2], [0, 2, 1]])
    mesh = smooth(control)
    wrong = [*sound(mesh), *([] if abs(mesh.volume) < 1e-12 else [f"volume: expected 0, got {mesh.volume:g}"])]
    return CaseMeasured(figure=outside_hull(mesh, control), wrong=tuple(wrong))


@hard_case(name="mesh/loop-valence-3", bound=1e-12, figure="deviation from the weights by hand",
           expectation="a regular tetrahedron, all valences 3, shrinks to what the weights say by hand",
           failure="a body that collapses or bulges: valence 3 has its own weight")
def valence_three(size: Size) -> CaseMeasured:
    """One round: corner v goes to 7/16 v + 3/16 of the others' sum -v, a quarter; edge a b to (a + b) / 4."""
    corners = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    control = bare(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    once, _ = loop(control, rounds=1, creases=np.zeros((0, 2), int))
    ends = edges_of(control.faces).vertices
    by_hand = np.concatenate([corners / 4, corners[ends].sum(axis=1) / 4])
    rounded = bounded(control, least=0.03)
    return CaseMeasured(figure=rounded.figure + float(np.abs(once.positions - by_hand).max()), wrong=rounded.wrong)


valence_sixty = Case(
    name="mesh/loop-valence-60", bound=1e-12, figure=OUTSIDE, measure=lambda size: bounded(bipyramid(60), least=0.5),
    expectation="a double cone of sixty sides rounds within its hull and keeps half of its volume",
    failure="a crater or a spike at the apex: a neighbour's weight that does not fall with their number")


@hard_case(name="mesh/rough-base-keeps-volume", bound=0.03, figure="change of volume, relative",
           expectation="the rough base of a double cone of sixty sides has the volume of the cone",
           failure="rough meshes that are thinner or thicker than their object, so that masks do not match")
def rough_base_keeps_volume(size: Size) -> CaseMeasured:
    """As rough meshes are made, without their noise."""
    clean = bipyramid(60)
    base = rough_base(clean, edge_length=0.1, rounds=2, crease_angle=30)
    return CaseMeasured(figure=abs(base.mesh.volume / clean.volume - 1), wrong=tuple(sound(base.mesh)))


@hard_case(name="mesh/loop-fan-of-five", bound=1e-12, figure="farthest vertex of the shared edge off its line",
           expectation="where five sheets share an edge, subdivision leaves the edge where it is",
           failure="an edge that bends towards one of its sheets, or a crash: two faces to an edge are assumed")
def fan_of_five(size: Size) -> CaseMeasured:
    """Not a manifold."""
    angle = 2 * math.pi * np.arange(5) / 5
    tips = np.stack([np.cos(angle), np.sin(angle), np.full(5, 0.5)], axis=1)
    fan = bare(np.concatenate([[[0, 0, 0], [0, 0, 1]], tips]), [[0, 1, 2 + i] for i in range(5)])
    mesh = smooth(fan)
    edges = edges_of(mesh.faces)
    shared = mesh.positions[np.unique(edges.vertices[edges.face_count == 5])]
    expected = 2**ROUNDS + 1
    wrong = sound(mesh) + ([] if len(shared) == expected else [f"expected {expected} vertices on the shared edge, got "
                                                               f"{len(shared)}"])
    return CaseMeasured(figure=float(np.abs(shared[:, :2]).max(initial=0.0)) + outside_hull(mesh, fan),
                        wrong=tuple(wrong))


@hard_case(name="mesh/loop-touching-tips", bound=1e-12, figure="how far the tip moves, and others leave the hull",
           expectation="where two bodies touch in a vertex, subdivision leaves the vertex where it is",
           failure="bodies that are torn or melted together: neighbours of both are averaged")
def touching_tips(size: Size) -> CaseMeasured:
    """Two pyramids, tip to tip."""
    corners = np.array([[0, 0, 0], [1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1],
                        [1, 1, -1], [-1, 1, -1], [-1, -1, -1], [1, -1, -1]])
    up = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 4, 3], [1, 3, 2]]
    down = [[0, 6, 5], [0, 7, 6], [0, 8, 7], [0, 5, 8], [5, 7, 8], [5, 6, 7]]
    control = bare(corners, up + down)
    mesh = smooth(control)
    return CaseMeasured(figure=float(np.abs(mesh.positions[0]).max()) + outside_hull(mesh, control),
                        wrong=tuple(sound(mesh)))


@hard_case(name="mesh/normals-of-rubbish", bound=1e-6, figure="largest deviation of a normal's length from 1",
           expectation="faces without area, doubled, and folded back by half a turn have normals of length 1",
           failure="NaN normals, which turn pixels black or the whole picture into NaN")
def normals_of_rubbish(size: Size) -> CaseMeasured:
    """Points, lines, twins in both windings, and a face folded onto its neighbour."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [2, 0, 0], [0.2, 0.2, 1e-12], [0, 0, 1e-300]])
    faces = [[0, 0, 0], [0, 1, 3], [0, 1, 4], [0, 1, 2], [0, 1, 2], [0, 2, 1], [1, 0, 5], [0, 6, 1], [5, 5, 2]]
    normals = corner_normals(bare(points, faces))
    return CaseMeasured(figure=float(np.abs(np.linalg.norm(normals, axis=2) - 1).max()))


@hard_case(name="mesh/rough-twin-of-rubbish", bound=1e-9, figure="change of volume by repair, relative",
           expectation="a ball with doubled, flat and stray faces is repaired to the ball, and its rough base is "
                       "finite",
           failure="a repair that opens holes, or NaN that reach the renderer")
def rough_twin_of_rubbish(size: Size) -> CaseMeasured:
    """Vertices at the seam and at the poles stand twice or more."""
    clean = ball_mesh(12)
    faces = np.concatenate([clean.faces, clean.faces[100:120], [[3, 3, 9], [5, 5, 5]]])
    mended, report = repair(bare(clean.positions, faces))
    base = rough_base(mended, edge_length=0.2, rounds=1, crease_angle=30)
    wrong = sound(mended) + sound(base.mesh)
    wrong += [] if report.duplicate == 20 else [f"expected 20 duplicate faces, got {report.duplicate}"]
    open_edges = int(np.count_nonzero(edges_of(mended.faces).face_count != 2))
    wrong += [] if not open_edges else [f"expected a closed mesh, got {open_edges} open edges"]
    return CaseMeasured(figure=abs(mended.volume / clean.volume - 1), wrong=tuple(wrong))


@hard_case(name="mesh/large-subdivision", bound=1e-9, figure="change of volume, relative",
           expectation="a box cut into 800 thousand faces (50 thousand in a small run) keeps its volume",
           failure="cracks or lost faces in large meshes: indices that overflow")
def large_subdivision(size: Size) -> CaseMeasured:
    """Every edge is a crease, so that the shape is kept exactly."""
    clean = box_mesh((-1, -1, -1), (1, 1, 1))
    rounds = round(math.log(size.faces / 4 / 12, 4))
    mesh, _ = loop(clean, rounds=rounds, creases=np.ones(len(edges_of(clean.faces).vertices), bool))
    counts = edges_of(mesh.faces).face_count
    wrong = () if (counts == 2).all() else ("expected a closed mesh",)
    return CaseMeasured(figure=abs(mesh.volume / clean.volume - 1), wrong=wrong)
