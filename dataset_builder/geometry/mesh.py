"""The mesh that flows through the builder: arrays, nothing else."""

from dataclasses import dataclass

import numpy as np

from dataset_builder.errors import UserError


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleMesh:
    """Indexed triangles, welded by position; texture coordinates, colours and materials belong to faces, so a seam
    opens no crack.

    Arrays are made read-only. Raises UserError on wrong shapes, indices out of range and non-finite positions.
    """

    positions: np.ndarray
    """(V, 3) float64, metres."""
    faces: np.ndarray
    """(F, 3) int32 into positions, counter-clockwise seen from outside."""
    uvs: np.ndarray
    """(F, 3, 2) float64, per corner."""
    material: np.ndarray
    """(F,) int32 index into the materials of the asset."""
    colors: np.ndarray | None = None
    """(F, 3, 4) float32 per corner, linear Rec.709 and coverage in [0, 1], that multiply base colour and alpha; None is
    all ones."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", np.ascontiguousarray(self.positions, dtype=np.float64))
        object.__setattr__(self, "faces", np.ascontiguousarray(self.faces, dtype=np.int32))
        object.__setattr__(self, "uvs", np.ascontiguousarray(self.uvs, dtype=np.float64))
        object.__setattr__(self, "material", np.ascontiguousarray(self.material, dtype=np.int32))
        arrays = [self.positions, self.faces, self.uvs, self.material]
        if self.colors is not None:
            object.__setattr__(self, "colors", np.ascontiguousarray(self.colors, dtype=np.float32))
            arrays.append(self.colors)
        self._check()
        for array in arrays:
            array.flags.writeable = False

    def _check(self) -> None:
        count = len(self.faces)
        shapes = {"positions": (len(self.positions), 3), "faces": (count, 3), "uvs": (count, 3, 2),
                  "material": (count,)}
        if self.colors is not None:
            shapes["colors"] = (count, 3, 4)
        for name, expected in shapes.items():
            if (got := getattr(self, name).shape) != expected:
                raise UserError(f"mesh: {name}: expected shape {expected}, got {got}")
        if count and (self.faces.min() < 0 or self.faces.max() >= len(self.positions)):
            raise UserError(f"mesh: faces: expected indices in [0, {len(self.positions)}), got "
                            f"[{self.faces.min()}, {self.faces.max()}]")
        bad = np.flatnonzero(~np.isfinite(self.positions).all(axis=1))
        if len(bad):
            raise UserError(f"mesh: positions: expected finite numbers, got {len(bad)} vertices with NaN or Inf, "
                            f"first at vertex {bad[0]}")

    @property
    def corners(self) -> np.ndarray:
        """(F, 3, 3) positions of every face's corners."""
        return self.positions[self.faces]

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) smallest and largest coordinates of the vertices that faces use."""
        used = self.corners.reshape(-1, 3)
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def size(self) -> tuple[float, float, float]:
        """Width, depth and height: extents along x, y and z."""
        width, depth, height = np.ptp(self.bounds, axis=0).tolist()
        return width, depth, height

    @property
    def area_normals(self) -> np.ndarray:
        """(F, 3) face normals, twice the face's area long; zero for a degenerate face."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a)

    @property
    def volume(self) -> float:
        """Signed enclosed volume in cubic metres (divergence theorem); meaningful for closed meshes."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def transform(mesh: TriangleMesh, world_from_object: np.ndarray) -> TriangleMesh:
    """The mesh with its positions moved by a (4, 4) affine matrix; a mirroring matrix also flips the winding."""
    linear, offset = world_from_object[:3, :3], world_from_object[:3, 3]
    order = [0, 2, 1] if np.linalg.det(linear) < 0 else [0, 1, 2]
    return TriangleMesh(positions=mesh.positions @ linear.T + offset, faces=mesh.faces[:, order],
                        uvs=mesh.uvs[:, order], material=mesh.material,
                        colors=None if mesh.colors is None else mesh.colors[:, order])


def concatenate(meshes: list[TriangleMesh], *, material_offsets: list[int] | None = None) -> TriangleMesh:
    """One mesh of several, vertices kept apart; `material_offsets[i]` is added to the material indices of mesh i."""
    offsets = material_offsets or [0] * len(meshes)
    firsts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    return TriangleMesh(
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        faces=np.concatenate([mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)]),
        uvs=np.concatenate([mesh.uvs for mesh in meshes]),
        material=np.concatenate([mesh.material + offset for mesh, offset in zip(meshes, offsets, strict=True)]),
        colors=joined_colors([(len(mesh.faces), mesh.colors) for mesh in meshes]),
    )


def joined_colors(parts: list[tuple[int, np.ndarray | None]]) -> np.ndarray | None:
    """(F, 3, 4) colours of several (number of faces, colours) in order; ones where a part has none, None if all do."""
    if all(colors is None for _, colors in parts):
        return None
    return np.concatenate([np.ones((count, 3, 4), np.float32) if colors is None else colors for count, colors in parts])
