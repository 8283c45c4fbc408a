"""Shapes with known properties, for the tests of geometry."""

from collections.abc import Callable

import numpy as np
import pytest

from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.repair import repair

Shape = Callable[..., TriangleMesh]


def mesh_of(positions: object, faces: object, uvs: object = None) -> TriangleMesh:
    """A mesh of one material whose uvs are its x and y where none are given."""
    positions, faces = np.asarray(positions, dtype=float).reshape(-1, 3), np.asarray(faces, dtype=int).reshape(-1, 3)
    uvs = positions[faces][..., :2] if uvs is None else np.asarray(uvs, dtype=float)
    return TriangleMesh(positions=positions, faces=faces, uvs=uvs, material=np.zeros(len(faces), int))


def box(size: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> TriangleMesh:
    """Twelve triangles, every side with its own square of texture: all twelve edges are uv seams."""
    corners = (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5) * size
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    faces, uvs = quads[:, [[0, 1, 2], [0, 2, 3]]], np.tile(square[[[0, 1, 2], [0, 2, 3]]], (6, 1, 1, 1))
    return mesh_of(corners, faces, uvs.reshape(-1, 3, 2))


def chamfered_box(size: float = 1.0, chamfer: float = 0.04) -> TriangleMesh:
    """A cube whose edges are cut at 45 degrees: the hull of its 24 corners."""
    inner, outer = size / 2 - chamfer, size / 2
    signs = np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1
    return hull(np.concatenate([signs * np.where(np.arange(3) == axis, outer, inner) for axis in range(3)]))


def hull(points: np.ndarray) -> TriangleMesh:
    """Convex hull, wound to the outside."""
    from scipy.spatial import ConvexHull
    faces = ConvexHull(points, qhull_options="Qt").simplices
    a, b, c = np.moveaxis(points[faces], 1, 0)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) < 0
    return mesh_of(points, np.where(inwards[:, None], faces[:, ::-1], faces))


def lathe(profile: list[tuple[float, float]], sides: int) -> TriangleMesh:
    """Solid of revolution about z of (radius, z) points; radius 0 makes a pole."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, z)], axis=1) for r, z in profile]
    here, right = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = []
    for low in range(len(profile) - 1):
        a, b, c, d = low * sides + here, low * sides + right, (low + 1) * sides + right, (low + 1) * sides + here
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    mesh = mesh_of(np.concatenate(rings), np.concatenate(faces))
    return repair(mesh)[0]


def cylinder(radius: float = 0.3, height: float = 0.8, sides: int = 32) -> TriangleMesh:
    """Closed cylinder with fans for caps."""
    return lathe([(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)], sides)


def vase(sides: int = 40) -> TriangleMesh:
    """A lathe with a smooth belly, a neck and two sharp rims."""
    t = np.linspace(0, np.pi, 24)
    belly = [(0.12 + 0.1 * np.sin(s), 0.4 * s / np.pi) for s in t]
    return lathe([(0.0, 0.0), *belly, (0.0, 0.4)], sides)


def torus(major: int = 24, minor: int = 12) -> TriangleMesh:
    """Closed and smooth everywhere: no vertex has other than six neighbours."""
    u, v = np.meshgrid(2 * np.pi * np.arange(major) / major, 2 * np.pi * np.arange(minor) / minor, indexing="ij")
    ring = 1 + 0.4 * np.cos(v)
    positions = np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], axis=2).reshape(-1, 3)
    i, j = np.indices((major, minor)).reshape(2, -1)
    a, b = i * minor + j, (i + 1) % major * minor + j
    c, d = (i + 1) % major * minor + (j + 1) % minor, i * minor + (j + 1) % minor
    return mesh_of(positions, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def grid(count: int = 4) -> TriangleMesh:
    """An open unit square in the plane z = 0, facing up."""
    x, y = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1), indexing="ij")
    i, j = np.indices((count, count)).reshape(2, -1)
    a, step = i * (count + 1) + j, count + 1
    faces = np.concatenate([np.stack([a, a + step, a + step + 1], 1), np.stack([a, a + step + 1, a + 1], 1)])
    return mesh_of(np.stack([x, y, 0 * x], axis=2), faces)


SHAPES: dict[str, Shape] = {
    "box": box, "chamfered": chamfered_box, "cylinder": cylinder, "vase": vase, "torus": torus, "grid": grid,
    "lathe": lathe, "mesh": mesh_of,
}


@pytest.fixture
def shapes() -> dict[str, Shape]:
    """Functions that make meshes, by name."""
    return SHAPES
