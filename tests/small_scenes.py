"""Small scenes made of boxes and balls, for tests that render."""

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.geometry.edges import corner_normals
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.example_plan import RenderPlan
from dataset_builder.label.scene_plan import CameraPlan, IlluminationPlan, LightPlan
from dataset_builder.rendering.scene.triangle_soup import Soup, merge, soup_of


def ball(material: Material, centre=(0.0, 0.0, 0.0), radius: float = 1.0, instance: int = 1,
         segments: int = 24) -> Soup:
    """A latitude-longitude ball, smooth-shaded, with texture coordinates."""
    v, u = np.meshgrid(np.linspace(0, 1, segments + 1), np.linspace(0, 1, 2 * segments + 1), indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    uvs = np.stack([u, 1 - v], axis=-1)
    a, b, c, d = (grid for grid in ((slice(None, -1), slice(None, -1)), (slice(1, None), slice(None, -1)),
                                    (slice(1, None), slice(1, None)), (slice(None, -1), slice(1, None))))
    quads = [np.stack([grid[corner].reshape(-1, grid.shape[-1]) for corner in corners], axis=1)
             for grid in (points, uvs) for corners in ((a, b, c), (a, c, d))]
    normals, uv = np.concatenate(quads[:2]), np.concatenate(quads[2:])
    area = np.linalg.norm(np.cross(normals[:, 1] - normals[:, 0], normals[:, 2] - normals[:, 0]), axis=1)
    normals, uv = normals[area > 1e-9], uv[area > 1e-9]
    return Soup(corners=np.array(centre) + radius * normals, normals=normals, uvs=uv, materials=(material,),
                material=np.zeros(len(normals), int), instance=np.full(len(normals), instance),
                part=np.zeros(len(normals), int))


def box(material: Material, low, high, instance: int = 2) -> Soup:
    """An axis-aligned box with flat faces."""
    low, high = np.array(low, float), np.array(high, float)
    points = np.array([[(high if x else low)[0], (high if y else low)[1], (high if z else low)[2]]
                       for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = np.array([face for q in quads for face in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))])
    uvs = np.tile(np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float), (6, 1, 1))
    mesh = TriangleMesh(positions=points, faces=faces, uvs=uvs, material=np.zeros(12, int))
    return soup_of(mesh, corner_normals(mesh), (material,), np.eye(4), instance)


def matte(albedo=(0.5, 0.5, 0.5)) -> Material:
    """A Lambertian surface."""
    return Material(name="matte", base_color=tuple(albedo), specular=0.0)


def light(kind: str, radiance=(1.0, 1.0, 1.0), **values) -> LightPlan:
    """A light with plain defaults."""
    given = {"position": (0, 0, 3), "direction": (0, 0, -1), "size": 0.3, "cutoff": 40, "temperature": 0, "weight": 1}
    return LightPlan(kind=kind, radiance=radiance, **(given | values))


def lit_by(*lights: LightPlan) -> IlluminationPlan:
    """An illumination of these lights."""
    return IlluminationPlan(lights=lights, open=())


def camera(position=(0.0, -4.0, 1.0), target=(0.0, 0.0, 0.0), fov: float = 40.0) -> CameraPlan:
    """A camera that looks at the origin."""
    return CameraPlan(position=position, target=target, up=(0, 0, 1), fov=fov, coverage=0.2, visibility=1.0)


def render_plan(size: int = 32, batches: int = 4, rr_depth: int = 5) -> RenderPlan:
    """A small square frame with all of the paper's layers."""
    return RenderPlan(width=size, height=size, layers=(("i_t", "frame"),), spp_first_hit=16, spp_source=16,
                      spp_target=16, spp_rough=16, batches=batches, rr_depth=rr_depth, seed="1")


def corner_of_a_room(target: Soup) -> Soup:
    """Floor and two walls about a target: something to bounce light and to cast shadows on."""
    red, green = matte((0.6, 0.2, 0.2)), Material(name="gloss", base_color=(0.2, 0.5, 0.3), roughness=0.4)
    return merge([target, box(matte((0.7, 0.7, 0.7)), (-3, -3, -1.2), (3, 3, -1)), box(red, (-3, 2, -1), (3, 2.2, 3)),
                  box(green, (-2.2, -3, -1), (-2, 2, 3)),
                  box(matte((0.3, 0.4, 0.7)), (0.9, -0.9, -1), (1.3, -0.5, 0.6), 3)])


def sheet(material: Material, y: float, half: float, instance: int = 1, colors=None) -> Soup:
    """An upright square of two triangles that faces the camera, with the whole texture on it."""
    points = np.array([[-half, y, -half], [half, y, -half], [half, y, half], [-half, y, half]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = TriangleMesh(positions=points, faces=faces, uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)[faces],
                        material=np.zeros(2, int), colors=colors)
    return soup_of(mesh, corner_normals(mesh), (material,), np.eye(4), instance)
