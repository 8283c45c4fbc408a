"""What light paths send straight to the camera: links of light vertices with the camera itself.

This is how caustics are found: of all techniques, none other meets a surface that a lamp lights over smooth glass or a
mirror. A vertex adds to the pixel that it is seen in

    flux f cos_s / cos_n * cos_in / d^2 * p_0 / paths,

p_0 the density of a pixel's rays per steradian (Veach 1997, section 10.3.2, light tracing), times its weight, which
`weights` calls L0. Light that comes straight from a lamp is left to light samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.surface.first_hit import coverage, first_hit, mixture_pdf
from dataset_builder.rendering.transport.joined_paths import LightSide
from dataset_builder.rendering.transport.light_paths import EDGES, LightVertices
from dataset_builder.rendering.transport.light_sampling import World, same_side, straight_on
from dataset_builder.rendering.transport.weights import edge, link, linked


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera:
    """A pinhole, as light paths see it."""

    pinhole: Pinhole
    eye: mi.Point3f
    forward: mi.Vector3f
    pixel_area: mi.Float
    """At distance 1."""

    def pixel_pdf(self, direction: mi.Vector3f) -> mi.Float:
        """p_0 of a unit direction from the eye: 1 / (A cos^3), A the pixel's area at distance 1."""
        return dr.rcp(self.pixel_area * dr.dot(direction, self.forward) ** 3)


def light_image(world: World, light: LightSide, camera: Camera, found: LightVertices, pixels: np.ndarray,
                groups: np.ndarray, wanted: Sequence[str]) -> np.ndarray:
    """(P, B, 3 N) what reaches pixels (P,) in each of groups (P, B), of the N wanted layers; nothing of squares, which
    are of camera paths alone, and of air."""
    row, pixel = _seen(camera.pinhole, found, pixels)
    if not len(row):
        return np.zeros((*groups.shape, 3 * len(wanted)))
    values = [owned(mi.Float, found.values[row, k].astype(np.float32)) for k in range(found.values.shape[1])]
    group = found.path[row] // found.paths
    sent = _sent(world, light, camera, values, owned(mi.UInt32, found.prim[row]), owned(mi.UInt32, group))
    dr.eval(sent)
    frame = camera.pinhole.width * camera.pinhole.height
    place = group.astype(np.int64) * frame + pixel
    asked, size = groups.astype(np.int64) * frame + pixels[:, None], found.sets * frame
    channels = [sent[name][k] if name in sent else None for name in wanted for k in range(3)]
    sums = [np.zeros(groups.shape) if channel is None else
            np.bincount(place, np.array(channel, dtype=np.float64), minlength=size)[asked] for channel in channels]
    return np.stack(sums, axis=-1) / found.paths


def _seen(pinhole: Pinhole, found: LightVertices, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(V,) vertices whose light has bounced and that project to one of the pixels, and which."""
    bounced = np.flatnonzero(found.values[:, EDGES] > 1)
    column, row, distance = pinhole.project(found.values[bounced, :3].astype(np.float64)).T
    inside = (distance > 0) & (column >= 0) & (row >= 0) & (column < pinhole.width) & (row < pinhole.height)
    pixel = np.zeros(len(bounced), dtype=np.int64)
    pixel[inside] = np.floor(row[inside]).astype(np.int64) * pinhole.width + np.floor(column[inside]).astype(np.int64)
    asked = np.zeros(pinhole.width * pinhole.height, dtype=bool)
    asked[pixels] = True
    inside &= asked[pixel]
    return bounced[inside], pixel[inside]


def _sent(world: World, light: LightSide, camera: Camera, values: list[mi.Float], prim: mi.UInt32,
          group: mi.UInt32) -> dict[str, mi.Color3f]:
    """What each vertex adds to its pixel, weighed, times the number of paths."""
    p, back, flux, uv = (mi.Point3f(*values[0:3]), mi.Vector3f(*values[3:6]), mi.Color3f(*values[6:9]),
                         mi.Point2f(*values[9:11]))
    h_camera, g, g2 = values[11], values[14], values[15]
    way = p - camera.eye
    distance_squared = dr.squared_norm(way)
    look = mi.Ray3f(camera.eye, way * dr.rsqrt(distance_squared))
    preliminary = dr.zeros(mi.PreliminaryIntersection3f)
    preliminary.t, preliminary.prim_uv, preliminary.prim_index = dr.sqrt(distance_squared), uv, prim
    preliminary.shape, preliminary.valid = light.shape, mi.Bool(True)
    si = preliminary.compute_surface_interaction(look, mi.RayFlags.All)
    sight = dr.select(same_side(world, si, look.d, back), _in_sight(world, camera, si), 0)
    active = sight > 0

    # The surface, as the camera sees it
    hit = first_hit(si.bsdf(look), si, [si.to_local(back)], mi.Bool(False), mi.Float(0.5), mi.Point2f(0.5), active)
    there = hit.towards[0]
    cos_in, cos_out = dr.abs(dr.dot(si.n, look.d)), dr.abs(dr.dot(si.n, back))
    pdf = mixture_pdf(there.pdf, there.cosine, world.cosine_share)
    pixel_pdf = camera.pixel_pdf(look.d)

    # Its weight: the camera, and the links at the first and the second hit
    trust1, trust2 = light.trust(group)
    own = link(edge(light.splats, distance_squared, pixel_pdf, cos_in), cos_out, pdf)
    others = dr.select(pdf > 0, trust1 * g / pdf, 0) + trust2 * g2
    weight = linked(own, h_camera, others) * sight * cos_in * pixel_pdf / (distance_squared * cos_out)
    light_there = dr.select(active & (cos_out > 0), flux * weight, 0)
    brings = {"image": there.value, "shading": mi.Color3f(there.cosine),
              "specular": there.value - hit.diffuse * there.cosine}
    return {name: value * light_there for name, value in brings.items() if name in world.wanted}


def _in_sight(world: World, camera: Camera, si: mi.SurfaceInteraction3f) -> mi.Float:
    """Share of the sight from the camera to a surface that nothing ends, and that the surface does not pass."""
    if not world.coverage:
        return dr.select(world.scene.ray_test(si.spawn_ray_to(camera.eye), coherent=False), mi.Float(0), 1)
    return straight_on(world.scene, si, camera.eye, _gaps, mi.Bool(True)).x * coverage(si.bsdf(), si, mi.Bool(True))


def _gaps(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
    """Sight passes what is not there; a pane is the first surface."""
    return mi.Color3f(1 - coverage(bsdf, si, active))
