"""The surface of a grid of values at a level: the only module that asks scikit-image for marching cubes."""

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dataset_builder.geometry.mesh import TriangleMesh

LEAST_PART = 0.01
"""Parts with fewer triangles than this share of the largest are dropped."""


def solid(values: np.ndarray, level: float, seen: np.ndarray | None = None) -> np.ndarray:
    """`values`, with all made solid that a cube of 3 cells cannot reach from outside through `seen` values below
    `level`: what no camera sees says nothing of itself, and surfaces have holes. values, seen: (Z, Y, X); without
    `seen`, all is."""
    cube = np.ones((3, 3, 3), dtype=bool)
    free = np.pad((values < level) & (True if seen is None else seen), 2, constant_values=True)
    rooms, _ = ndimage.label(ndimage.binary_erosion(free, cube, border_value=1))
    inner = ~ndimage.binary_dilation(rooms == rooms[0, 0, 0], cube)[2:-2, 2:-2, 2:-2]
    # Two cells deep nothing is left of the surface between cells, and holes there would be surfaces of their own
    deep = ndimage.binary_erosion(inner, iterations=2)
    return np.where(deep | (inner & (values < level)), np.maximum(values, level + 1), values)


def level_mesh(values: np.ndarray, level: float, cell: float = 1.0) -> TriangleMesh | None:
    """The closed surface about values (Z, Y, X) above `level`, in units of `cell` from the corner of the first cell;
    None where there is none. Values stand for the middles of cells; around the grid is nothing.

    Lewiner et al., "Efficient implementation of marching cubes' cases with topological guarantees", 2003.
    """
    from skimage.measure import marching_cubes

    outside = min(float(values.min()), level - 1)
    padded = np.pad(values.astype(np.float64), 1, constant_values=outside)
    if padded.max() <= level:
        return None
    found, faces, _, _ = marching_cubes(padded, level, gradient_direction="ascent")
    return _bare(found[:, ::-1] * cell - 0.5 * cell, faces[:, ::-1])


def largest_parts(mesh: TriangleMesh, least: float = LEAST_PART) -> tuple[TriangleMesh, int, int]:
    """The mesh without its small connected parts; how many parts are left, and how many were dropped."""
    faces = mesh.faces
    count = len(mesh.positions)
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    _, label = connected_components(coo_matrix((np.ones(len(edges), bool), edges.T), (count, count)), directed=False)
    part = label[faces[:, 0]]
    sizes = np.bincount(part, minlength=label.max(initial=-1) + 1)
    keep = sizes >= max(1, least * sizes.max())
    kept = faces[keep[part]]
    used, renumbered = np.unique(kept, return_inverse=True)
    return (_bare(mesh.positions[used], renumbered.reshape(-1, 3)), int(keep.sum()),
            int((sizes > 0).sum() - keep.sum()))


def _bare(positions: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    return TriangleMesh(positions=positions, faces=faces, uvs=np.zeros((len(faces), 3, 2)),
                        material=np.zeros(len(faces)))
