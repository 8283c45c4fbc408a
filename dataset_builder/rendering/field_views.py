"""Images of an object that a field is fitted to, and measured on: the object alone under the field's light, from all
around, rendered by this builder.

A path counts where its first surface is the object's: what is behind has no part in an image, whatever shines there,
and radiance comes multiplied by opacity from the same samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import pi, radians, sin
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.geometry.pinhole import Pinhole, sphere_lattice, unit
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.geometry.rough_base import bounding_radius
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import CameraPlan, ObjectPlan, PlacedObject, Vector
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.rendering import plugins
from dataset_builder.rendering.sampling.estimate import Samplers, estimate
from dataset_builder.rendering.scene.local_frame import LocalFrame
from dataset_builder.rendering.scene.open_scene import OpenScene, body_of, open_scene, sensor_of
from dataset_builder.rendering.scene.triangle_soup import Soup, clean
from dataset_builder.rendering.surface.material_table import Textures
from dataset_builder.rendering.surface.texels import needs
from dataset_builder.rendering.transport.integrator import trace
from dataset_builder.rendering.view_scenes import covered_window
from dataset_builder.rendering.view_sensor import primary_ray
from dataset_builder.seeding import derive_seed, rng

FOV = 45.0
"""Degrees."""
MARGIN = 1.03
"""Distance of cameras over the one from which the ball about the object fills the frame."""
BATCHES, ROULETTE, TEXTURE = 4, 5, 4096
UPRIGHT = 0.99
"""Cosine between the view and +Z from which another way is up in the image."""
MOST = float(np.finfo(np.float16).max)

Take = Callable[[int], np.ndarray]
"""Number of an image -> (H, W, 4) float16, as `PosedImages.pixels` has it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudioCameras:
    """Where the images of a field are taken from: those that it is fitted to, then those that it is measured on."""

    cameras: tuple[Pinhole, ...]
    """In the object's frame."""
    centre: Vector
    """Of the object's bounding box, metres."""
    radius: float
    """Of the sphere about that point through the farthest of the object, metres."""

    @classmethod
    def of(cls, target: ObjectPlan, field: FieldPlan, mesh_root: Path) -> StudioCameras:
        """The cameras of a plan."""
        mesh = asset_of(target, mesh_root).mesh
        centre, radius = mesh.bounds.mean(axis=0), bounding_radius(mesh)
        ways = directions(field.views, field.held_out, int(field.seed))
        distance = MARGIN * radius / sin(radians(FOV) / 2)
        x, y, z = centre.tolist()
        return cls(centre=(x, y, z), radius=radius, cameras=tuple(
            Pinhole(position=centre + distance * way, target=centre, fov=FOV, width=field.size, height=field.size,
                    up=np.array([0.0, 1, 0] if abs(way[2]) > UPRIGHT else [0.0, 0, 1])) for way in ways))

    def images(self, pixels: np.ndarray, chosen: slice) -> PosedImages:
        """Some of the images, of which `pixels` (N, H, W, 4) are all."""
        cameras = self.cameras[chosen]
        return PosedImages(pixels=pixels[chosen], poses=np.array([each.opencv_pose for each in cameras]),
                           focal=np.array([[each.focal] * 2 for each in cameras]),
                           centre=np.array([[each.width / 2, each.height / 2] for each in cameras]))


def directions(views: int, held_out: int, seed: int) -> np.ndarray:
    """(views + held_out, 3) unit vectors towards cameras: a Fibonacci lattice on the whole sphere, turned at random,
    then random ones, uniform on the sphere."""
    # Columns of a matrix of Gaussians, made orthonormal: a uniform rotation, or one mirrored
    turn, _ = np.linalg.qr(rng(seed, "turn").standard_normal((3, 3)))
    return np.concatenate([sphere_lattice(views) @ turn.T, unit(rng(seed, "held out").standard_normal((held_out, 3)))])


def white_of(field: FieldPlan) -> float:
    """Radiance of white paper in the light of a field, as `pass_inputs.sky_radiance` has it."""
    return field.light.lights[0].weight / pi


@contextmanager
def studio(target: ObjectPlan, field: FieldPlan, cameras: StudioCameras, mesh_root: Path) -> Iterator[Take]:
    """What takes the images of a field, one at a time; `backend.activate` must have run in this process.

    Each image has random numbers of its own, so that any of them can be taken alone. Raises PlanError as
    `open_scene` does.
    """
    plugins.register()
    soup = clean(PlacedObject(object=target, instance=1, position=(0.0, 0.0, 0.0), yaw=0.0), mesh_root)
    frame = LocalFrame.of(soup.corners)
    placed = frame.soup(soup)
    textures = Textures.upload(soup.materials, TEXTURE, white_of(field))
    with open_scene(body_of(placed, textures, _features(soup)), frame.illumination(field.light),
                    image_root=mesh_root) as opened:
        points = placed.corners.reshape(-1, 3)

        def take(number: int) -> np.ndarray:
            return _image(opened, _in_frame(cameras.cameras[number], frame), points, field, number)

        yield take


def _image(opened: OpenScene, camera: CameraPlan, points: np.ndarray, field: FieldPlan, number: int) -> np.ndarray:
    """One image. camera, points (N, 3): in the frame of the scene."""
    sensor = sensor_of(camera, field.size, field.size)
    longest, roulette = dr.opaque(mi.UInt32, field.max_depth), dr.opaque(mi.UInt32, ROULETTE)

    def integrand(samplers: Samplers, position: mi.Vector2f) -> list[mi.Float]:
        found = trace(opened.scene, samplers.strata, samplers.rest, primary_ray(sensor, position), longest, roulette,
                      features=opened.features, wanted=frozenset({"image"}))
        return [dr.select(found.valid, channel, 0) for channel in (*found.image, mi.Float(1))]

    pixels = covered_window(Pinhole.of(camera, field.size, field.size), points)
    image = np.zeros((field.size**2, 4), dtype=np.float16)
    found = estimate(integrand, pixels, width=field.size, height=field.size, spp=field.spp, batches=BATCHES,
                     seed=derive_seed(int(field.seed), "image", number))
    image[pixels] = np.clip(found.mean, 0, MOST)
    return image.reshape(field.size, field.size, 4)


def _features(soup: Soup) -> frozenset[str]:
    """What kernels must do for an object."""
    coloured = {"colours"} if soup.colors is not None else set()
    there = {"coverage"} if soup.colors is not None and soup.colors[..., 3].min(initial=1) < 1 else set()
    return needs(soup.materials) | coloured | there


def _in_frame(camera: Pinhole, frame: LocalFrame) -> CameraPlan:
    (px, py, pz), (tx, ty, tz) = camera.position.tolist(), camera.target.tolist()
    ux, uy, uz = camera.up.tolist()
    return frame.camera(CameraPlan(position=(px, py, pz), target=(tx, ty, tz), up=(ux, uy, uz), fov=camera.fov,
                                   coverage=1.0, visibility=1.0))
