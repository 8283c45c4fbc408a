"""Rays against many meshes at once, for planning: what is seen, what is hidden, how far is the nearest surface.

The only module that imports Open3D, and late: it takes seconds and needs a system library that its wheel lacks.
"""

import importlib
from collections.abc import Iterable
from types import ModuleType

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import unit

PACKAGES = {"libusb-1.0": "libusb-1.0-0", "libGL": "libgl1", "libEGL": "libegl1", "libX11": "libx11-6",
            "libidn2": "libidn2-0"}
"""Of the system libraries that Open3D is linked with, those of Debian and Ubuntu."""
NOTHING = 0
"""Id of a ray that meets no surface."""


def open3d() -> ModuleType:
    """The module `open3d`. Raises UserError with the command that mends it where it or a system library is missing."""
    try:
        return importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise missing(error) from error


def missing(error: Exception) -> UserError:
    """What to do about a failed import of Open3D."""
    for library, package in PACKAGES.items():
        if f"{library}." in str(error):
            return UserError(f"Open3D: expected the system library {library}, got: {error}; on Debian or Ubuntu: "
                             f"apt-get install {package}")
    return UserError(f"Open3D: expected it to import, got: {error}; install the locked dependencies again")


class RayScene:
    """Meshes that rays can meet. Answers do not depend on the number of threads.

    meshes: (positions (V, 3) in metres, faces (F, 3), id) each, ids positive, several meshes may share one; meshes
    without faces are left out. Float32 inside: distances are good to about 1e-6 of the scene's size.
    """

    def __init__(self, meshes: Iterable[tuple[np.ndarray, np.ndarray, int]]):
        self._o3d = open3d()
        # One thread: where surfaces coincide, the winner depends on the tree, and that on the threads that build it.
        self._scene = self._o3d.t.geometry.RaycastingScene(nthreads=1)
        ids = []
        for positions, faces, number in meshes:
            if number <= NOTHING:
                raise ValueError(f"expected ids > {NOTHING}, got {number}")
            if len(faces):
                self._scene.add_triangles(self._tensor(positions), self._tensor(faces, np.uint32))
                ids.append(number)
        self._ids = np.array([*ids, NOTHING], dtype=np.int64)

    def first_hit(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ids (N,) int64 and distances (N,) float64 in metres of the first surfaces along rays from (N, 3) origins
        along (N, 3) directions of any positive length; 0 and inf where there is none."""
        length = np.linalg.norm(directions, axis=1)
        if not len(self._ids) - 1 or not len(length):
            return np.full(len(length), NOTHING), np.full(len(length), np.inf)
        rays = np.concatenate([origins, directions / length[:, None]], axis=1)
        answer = self._scene.cast_rays(self._tensor(rays))
        slot = np.minimum(answer["geometry_ids"].numpy().astype(np.int64), len(self._ids) - 1)
        return self._ids[slot], answer["t_hit"].numpy().astype(np.float64)

    def normals(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(N, 3) float64 unit normals of the first surfaces along rays (N, 3), turned against the rays; 0 where none
        is."""
        if not len(self._ids) - 1 or not len(origins):
            return np.zeros((len(origins), 3))
        answer = self._scene.cast_rays(self._tensor(np.concatenate([origins, directions], axis=1)))
        normals = answer["primitive_normals"].numpy().astype(np.float64)
        facing = np.where(np.einsum("ij,ij->i", normals, directions) > 0, -1.0, 1.0)
        return normals * facing[:, None] * np.isfinite(answer["t_hit"].numpy())[:, None]

    def met(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the first surfaces along rays from (N, 3) along (N, 3): (N,) number of the face within its mesh, -1 where
        there is none; (N,) distance in lengths of the direction; (N, 3) shares of the face's corners."""
        if not len(self._ids) - 1 or not len(origins):
            return np.full(len(origins), -1), np.full(len(origins), np.inf), np.zeros((len(origins), 3))
        answer = self._scene.cast_rays(self._tensor(np.concatenate([origins, directions], axis=1)))
        distance, share = (answer[name].numpy().astype(np.float64) for name in ("t_hit", "primitive_uvs"))
        face = np.where(np.isfinite(distance), answer["primitive_ids"].numpy().astype(np.int64), -1)
        return face, distance, np.column_stack([1 - share.sum(axis=1), share])

    def hits(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Every surface that rays from (N, 3) origins along (N, 3) directions meet: (K,) number of the ray, (K,) number
        of the face within its mesh, (K,) distance in lengths of the direction."""
        return self.hits_within(origins, directions)[:3]

    def hits_within(self, origins: np.ndarray,
                    directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """As `hits`, and (K, 3) shares of the face's corners."""
        if not len(self._ids) - 1 or not len(origins):
            return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3))
        answer = self._scene.list_intersections(self._tensor(np.concatenate([origins, directions], axis=1)))
        ray, face = (answer[name].numpy().astype(np.int64) for name in ("ray_ids", "primitive_ids"))
        distance, share = (answer[name].numpy().astype(np.float64) for name in ("t_hit", "primitive_uvs"))
        return ray, face, distance, np.column_stack([1 - share.sum(axis=1), share])

    def occluded(self, origins: np.ndarray, targets: np.ndarray, *, epsilon: float = 1e-4) -> np.ndarray:
        """(N,) bool: a surface stands between (N, 3) origins and (N, 3) targets; the last `epsilon` metres before
        either end do not count, so that both may lie on surfaces."""
        between = targets - origins
        length = np.linalg.norm(between, axis=1)
        far = length > 2 * epsilon
        hidden = np.zeros(len(length), bool)
        if len(self._ids) - 1 and far.any():
            shorter = between[far] * (1 - 2 * epsilon / length[far])[:, None]
            start = origins[far] + between[far] * (epsilon / length[far])[:, None]
            rays = self._tensor(np.concatenate([start, shorter], axis=1))
            hidden[far] = self._scene.test_occlusions(rays, tnear=0.0, tfar=1.0).numpy()
        return hidden

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(N,) float64 unsigned distance in metres from (N, 3) points to the nearest surface; inf where there is
        none."""
        if not len(self._ids) - 1 or not len(points):
            return np.full(len(points), np.inf)
        return self._scene.compute_distance(self._tensor(points)).numpy().astype(np.float64)

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) float64 nearest surface points to (N, 3) points, and (N, 3) unit normals there, as faces wind; 0 for a
        face without area. Where several are as near, one of them. Raises ValueError where there is no surface."""
        if not len(self._ids) - 1:
            raise ValueError("expected a surface, got none")
        answer = self._scene.compute_closest_points(self._tensor(points))
        feet, normals = (answer[name].numpy().astype(np.float64) for name in ("points", "primitive_normals"))
        return feet, unit(np.nan_to_num(normals))

    def _tensor(self, array: np.ndarray, dtype: type = np.float32) -> object:
        # A copy: Open3D refuses read-only arrays.
        return self._o3d.core.Tensor(np.array(array, dtype=dtype, order="C"))
