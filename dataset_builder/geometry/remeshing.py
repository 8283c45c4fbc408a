"""Other triangles for the same surface: edges collapsed, a grid's cells, smoother, holes closed.

Open3D does the work, but for holes: what it fills stays open where their boundary has vertices in a line.

What a new face looks like is taken from the old mesh, at the place nearest to its middle, see `dressed`.
"""

from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import edges_of, unit
from dataset_builder.geometry.mesh import TriangleMesh, joined_colors
from dataset_builder.geometry.raycast import open3d
from dataset_builder.geometry.subdivision import EQUILATERAL

MAX_CELLS = 64_000_000
"""Cells of a grid, 256 MB of distances."""
INSIDE = 0.02
"""How far towards the middle of its face a corner is looked up, as a share of the way."""
AGREED = 0.5
"""Difference of two texture coordinates, in units of that between corner and middle, up to which they are of one chart:
the old faces of a seam are seldom so near to each other."""


def typical_edge(mesh: TriangleMesh) -> float:
    """Edge length in metres of the equilateral triangle as large as the face at the median of the surface: half of the
    area belongs to smaller faces. 0 for a mesh without area."""
    areas = np.sort(np.linalg.norm(mesh.area_normals, axis=1) / 2)
    summed = np.cumsum(areas)
    return float(np.sqrt(areas[np.searchsorted(summed, summed[-1] / 2)] / EQUILATERAL)) if len(areas) else 0.0


def decimated(mesh: TriangleMesh, edge_length: float) -> TriangleMesh:
    """Edges collapsed until there are as many faces as the surface has equilateral triangles of `edge_length` metres.

    Quadric error (M. Garland, P. Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997), in
    Open3D, on one thread. A closed mesh stays closed; open boundaries keep their loops. A mesh with fewer faces is
    returned as it is. Raises UserError for an edge length <= 0.
    """
    if not edge_length > 0:
        raise UserError(f"edge length: expected > 0 m, got {edge_length:g}")
    area = float(np.linalg.norm(mesh.area_normals, axis=1).sum()) / 2
    # A tetrahedron is the least that encloses anything
    target = max(int(area / (EQUILATERAL * edge_length**2)), 4)
    if target >= len(mesh.faces):
        return mesh
    made = _legacy(mesh).simplify_quadric_decimation(target)
    return dressed(np.asarray(made.vertices), np.asarray(made.triangles), mesh)


def smoothed(mesh: TriangleMesh, rounds: int) -> TriangleMesh:
    """`rounds` rounds of Taubin smoothing; faces, uvs and colours stay as they are."""
    made = _legacy(mesh).filter_smooth_taubin(number_of_iterations=rounds)
    return replace(mesh, positions=np.asarray(made.vertices))


def without_holes(mesh: TriangleMesh, radius: float) -> TriangleMesh:
    """Holes of at most `radius` metres (boundary length over 2 pi) closed by a fan about the middle of their boundary.

    The faces that there were stay first and as they were. Wide holes that are far from flat may get fans that intersect
    the surface.
    """
    edges = edges_of(mesh.faces)
    alone = edges.face_count[edges.of_face] == 1
    ends = np.stack([mesh.faces[alone], np.roll(mesh.faces, -1, axis=1)[alone]], axis=1)
    if not len(ends):
        return mesh
    used, compact = np.unique(ends, return_inverse=True)
    compact = compact.reshape(-1, 2)
    graph = coo_array((np.ones(len(ends), bool), (compact[:, 0], compact[:, 1])), shape=(len(used),) * 2)
    count, loop_of = connected_components(graph, directed=False)
    loop = loop_of[compact[:, 0]]
    starts, length = mesh.positions[ends[:, 0]], np.linalg.norm(np.subtract(*mesh.positions[ends.T]), axis=1)
    around = np.bincount(loop, weights=length, minlength=count)
    middles = np.stack([np.bincount(loop, weights=length * values, minlength=count) for values in
                        ((starts + mesh.positions[ends[:, 1]]) / 2).T], axis=1) / around[:, None]
    small = around <= 2 * np.pi * radius
    if not small.any():
        return mesh
    positions = np.concatenate([mesh.positions, middles])
    fans = np.concatenate([ends[:, ::-1], len(mesh.positions) + loop[:, None]], axis=1)[small[loop]]
    return join(replace(mesh, positions=positions), dressed(positions, fans, mesh, compacted=False))


def join(mesh: TriangleMesh, more: TriangleMesh) -> TriangleMesh:
    """The faces of two meshes that share their vertices."""
    colors = joined_colors([(len(each.faces), each.colors) for each in (mesh, more)])
    return TriangleMesh(positions=mesh.positions, faces=np.concatenate([mesh.faces, more.faces]),
                        uvs=np.concatenate([mesh.uvs, more.uvs]),
                        material=np.concatenate([mesh.material, more.material]), colors=colors)


def voxelised(mesh: TriangleMesh, size: float) -> TriangleMesh:
    """The surface as a grid of cells of `size` metres sees it: where the distance to a closed mesh changes sign, or,
    for an open one, where it is half a cell. Raises UserError where the grid would be too large."""
    o3d = open3d()
    low, high = mesh.bounds + np.array([[-2], [2]]) * size
    counts = np.ceil((high - low) / size).astype(int) + 1
    if np.prod(counts.astype(float)) > MAX_CELLS:
        raise UserError(f"voxels: expected at most {MAX_CELLS} cells, got {' x '.join(map(str, counts))}; raise size")
    scene = _scene(o3d, mesh)
    axes = [np.float32(low[axis]) + np.float32(size) * np.arange(counts[axis], dtype=np.float32) for axis in range(3)]
    points = np.stack(np.meshgrid(*axes[::-1], indexing="ij")[::-1], axis=-1)
    open_edges = (edges_of(mesh.faces).face_count == 1).any()
    distance = scene.compute_distance(points) if open_edges else scene.compute_signed_distance(points, nsamples=5)
    values = distance.numpy() - np.float32(size / 2 if open_edges else 0)
    made = o3d.t.geometry.TriangleMesh.create_isosurfaces(o3d.core.Tensor(values), [0.0])
    positions = made.vertex.positions.numpy().astype(np.float64) * size + low
    # Open3D takes more for inside, a distance has less there
    return dressed(positions, made.triangle.indices.numpy()[:, ::-1], mesh)


def dressed(positions: np.ndarray, faces: np.ndarray, old: TriangleMesh, *, compacted: bool = True) -> TriangleMesh:
    """A mesh of new triangles with the materials, uvs and colours of an old one.

    A face takes the material of the old face nearest to its centroid, and continues that face's uvs and colours over
    its own corners, so that no face runs across a seam. A corner has the uvs of the old face nearest to itself where
    these are about the same: small old faces that are a little askew lead astray over many times their size. Faces
    with a repeated corner are left out, and vertices that no face uses, too, if `compacted`. Raises UserError where no
    face is left.
    """
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if not len(faces):
        raise UserError("mesh: expected triangles to be left, got none; use a smaller size or edge")
    if compacted:
        used, compact = np.unique(faces, return_inverse=True)
        positions, faces = positions[used], compact.reshape(-1, 3)
    o3d = open3d()
    scene = _scene(o3d, old)
    corners = positions[faces]
    middles = corners.mean(axis=1)

    def nearest(points: np.ndarray) -> np.ndarray:
        found = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))
        return found["primitive_ids"].numpy().astype(np.int64)

    source = nearest(middles)
    weights = barycentric(corners, old.corners[source])
    uvs = np.einsum("fcw,fwn->fcn", weights, old.uvs[source])
    spans = np.linalg.norm(uvs - uvs.mean(axis=1, keepdims=True), axis=2)
    for corner in range(3):
        # A little inside, where the face on this side of a seam is the nearest
        own = nearest(corners[:, corner] + INSIDE * (middles - corners[:, corner]))
        said = np.einsum("fcw,fwn->fcn", barycentric(corners[:, [corner]], old.corners[own]), old.uvs[own])[:, 0]
        off = np.linalg.norm(said - uvs[:, corner], axis=1)
        agrees = (old.material[own] == old.material[source]) & (off <= AGREED * spans[:, corner])
        uvs[agrees, corner] = said[agrees]
    colors = None
    if old.colors is not None:
        colors = np.clip(np.einsum("fcw,fwn->fcn", weights, old.colors[source]), 0, 1)
    return TriangleMesh(positions=positions, faces=faces, uvs=uvs, material=old.material[source], colors=colors)


def barycentric(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(F, 3, 3) weights, adding up to 1, of the corners of (F, 3, 3) triangles at the feet of (F, 3, 3) points, three
    to each, in the triangles' planes; thirds for a triangle without area."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    square = np.einsum("fi,fi->f", normal, normal)
    flat = square <= 0
    normal, square = np.where(flat[:, None], 0, normal), np.where(flat, 1, square)
    offset = points - a[:, None]
    v = np.einsum("fci,fi->fc", np.cross(offset, (c - a)[:, None]), normal) / square[:, None]
    w = np.einsum("fci,fi->fc", np.cross((b - a)[:, None], offset), normal) / square[:, None]
    weights = np.stack([1 - v - w, v, w], axis=2)
    weights[flat] = 1 / 3
    return weights


def thin_faces(mesh: TriangleMesh, thickness: float) -> np.ndarray:
    """(F,) bool: a ray from the middle of the face into the body leaves it within `thickness` metres."""
    o3d = open3d()
    scene = _scene(o3d, mesh)
    inwards = -unit(mesh.area_normals)
    start = mesh.corners.mean(axis=1) + 1e-3 * thickness * inwards
    rays = np.concatenate([start, inwards], axis=1).astype(np.float32)
    hit = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
    return np.asarray(inwards.any(axis=1) & (hit < thickness))


def _legacy(mesh: TriangleMesh) -> Any:
    o3d = open3d()
    return o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(np.array(mesh.positions)),
                                     o3d.utility.Vector3iVector(np.array(mesh.faces)))


def _scene(o3d: ModuleType, mesh: TriangleMesh) -> Any:
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(o3d.t.geometry.TriangleMesh(
        o3d.core.Tensor(np.array(mesh.positions, dtype=np.float32, order="C")),
        o3d.core.Tensor(np.array(mesh.faces, dtype=np.int32, order="C"))))
    return scene
