"""Small scenes of boxes, balls and quads, with lights and cameras, that the cases are made of."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.geometry.edges import corner_normals
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.scene_plan import CameraPlan, IlluminationPlan, LightPlan
from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE
from dataset_builder.planning.scene.room_parts import ROOM_INSTANCE
from dataset_builder.rendering.scene.triangle_soup import Soup, merge, soup_of

Triple = tuple[float, float, float]
WIDE = 40.0
"""Half the side of a floor, in metres: wider than any camera here sees."""


def matte(albedo: float | Triple = 0.5) -> Material:
    """A Lambertian surface."""
    base = albedo if isinstance(albedo, tuple) else (albedo,) * 3
    return Material(name="matte", base_color=base, specular=0.0)


def sheet(points: np.ndarray, uvs: np.ndarray) -> TriangleMesh:
    """The triangles of a grid of (N, M, 3) points with (N, M, 2) texture coordinates, two a cell; vertices shared."""
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3)
    return TriangleMesh(positions=points.reshape(-1, 3), faces=faces, uvs=uvs.reshape(-1, 2)[faces],
                        material=np.zeros(len(faces), int))


def bare(positions: np.ndarray, faces: np.ndarray | Sequence[Sequence[int]]) -> TriangleMesh:
    """A mesh without texture coordinates."""
    faces = np.array(faces, dtype=int).reshape(-1, 3)
    return TriangleMesh(positions=np.array(positions, float), faces=faces, uvs=np.zeros((len(faces), 3, 2)),
                        material=np.zeros(len(faces), int))


def standing(mesh: TriangleMesh, material: Material, instance: int = TARGET_INSTANCE,
             normals: np.ndarray | None = None) -> Soup:
    """A mesh as the renderer gets it; without normals, those of `geometry.edges`."""
    return soup_of(mesh, corner_normals(mesh) if normals is None else normals, (material,), np.eye(4), instance)


def quad(material: Material, corner: Triple, along: Triple, up: Triple, *, cells: tuple[int, int] = (1, 1),
         instance: int = ROOM_INSTANCE) -> Soup:
    """A parallelogram; its winding is that of along x up."""
    u, v = np.meshgrid(np.linspace(0, 1, cells[0] + 1), np.linspace(0, 1, cells[1] + 1), indexing="ij")
    points = np.array(corner) + u[..., None] * np.array(along) + v[..., None] * np.array(up)
    return standing(sheet(points, np.stack([u, v], axis=-1)), material, instance)


def floor(material: Material | None = None, *, half: float = WIDE, height: float = 0.0,
          instance: int = ROOM_INSTANCE) -> Soup:
    """A square floor about the origin."""
    return quad(material or matte(), (-half, -half, height), (2 * half, 0, 0), (0, 2 * half, 0), instance=instance)


def ball_mesh(segments: int, centre: Triple = (0, 0, 0), radius: float = 1.0) -> TriangleMesh:
    """A latitude-longitude ball of about 4 segments^2 faces, closed once welded; those at the poles have no area."""
    v, u = np.meshgrid(np.linspace(0, 1, segments + 1), np.linspace(0, 1, 2 * segments + 1), indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return sheet(np.array(centre) + radius * points, np.stack([u, 1 - v], axis=-1))


def ball(material: Material, centre: Triple = (0, 0, 0), radius: float = 1.0, *, segments: int = 24,
         instance: int = TARGET_INSTANCE) -> Soup:
    """A ball with the shading normals of the sphere, without its faces of no area."""
    mesh = ball_mesh(segments, centre, radius)
    keep = np.linalg.norm(mesh.area_normals, axis=1) > 1e-9 * radius**2
    mesh = TriangleMesh(positions=mesh.positions, faces=mesh.faces[keep], uvs=mesh.uvs[keep],
                        material=mesh.material[keep])
    return standing(mesh, material, instance, normals=(mesh.corners - np.array(centre)) / radius)


def box_mesh(low: Triple, high: Triple) -> TriangleMesh:
    """An axis-aligned box that winds outwards."""
    points = [[(low, high)[x][0], (low, high)[y][1], (low, high)[z][2]]
              for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return bare(np.array(points), [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])


def box(material: Material, low: Triple, high: Triple, instance: int = ROOM_INSTANCE) -> Soup:
    """An axis-aligned box with flat faces."""
    return standing(box_mesh(low, high), material, instance)


def still_life(target: Soup) -> Soup:
    """Floor, two walls and a post about a target of radius 1 at the origin: bounces and shadows."""
    return merge([target, floor(matte(0.7), half=3, height=-1),
                  quad(matte((0.6, 0.2, 0.2)), (-3, 2, -1), (6, 0, 0), (0, 0, 4)),
                  quad(matte((0.2, 0.5, 0.3)), (-2, -3, -1), (0, 5, 0), (0, 0, 4)),
                  box(matte((0.3, 0.4, 0.7)), (0.9, -0.9, -1), (1.3, -0.5, 0.6), 3)])


def light(kind: str, radiance: float | Triple = 1.0, *, position: Triple = (0, 0, 3), direction: Triple = (0, 0, -1),
          size: float = 0.3, cutoff: float = 40.0, weight: float = 1.0) -> LightPlan:
    """A light with plain defaults."""
    return LightPlan.model_validate({
        "kind": kind, "radiance": radiance if isinstance(radiance, tuple) else (radiance,) * 3, "position": position,
        "direction": direction, "size": size, "cutoff": cutoff, "temperature": 0, "weight": weight})


def lit_by(*lights: LightPlan) -> IlluminationPlan:
    """All of an illumination."""
    return IlluminationPlan(lights=lights, open=())


def camera(position: Triple = (0.0, -4.0, 1.0), target: Triple = (0.0, 0.0, 0.0), fov: float = 40.0) -> CameraPlan:
    """A camera, upright."""
    return CameraPlan(position=position, target=target, up=(0, 0, 1), fov=fov, coverage=0.2, visibility=1.0)
