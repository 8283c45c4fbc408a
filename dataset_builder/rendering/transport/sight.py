"""What a camera ray meets: the first surface that is there, past lamps where they are no surfaces."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.first_hit import coverage
from dataset_builder.rendering.transport.light_sampling import World


@dr.syntax
def first_surface(scene: mi.Scene, ray: mi.Ray3f, body: mi.ShapePtr | None, choice: mi.Float | None,
                  active: mi.Bool) -> tuple[mi.Ray3f, mi.SurfaceInteraction3f]:
    """The first point that a ray meets, and the ray, set out where it last passed something, that meets it.

    body: all that counts as a surface; everything if None. choice: uniform in [0, 1), by which a surface of coverage a
    is there with probability a; None where all are. The number serves all surfaces on the way: below a it has done its
    work, and from a on (choice - a) / (1 - a) is uniform again. 0.5 finds where half of the sight has ended.
    """
    ray = mi.Ray3f(ray)
    si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True, active=active)
    past, choice = _passed(si, ray, body, choice, active)
    while past:
        ray = si.spawn_ray(ray.d)
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True, active=past)
        past, choice = _passed(si, ray, body, choice, past)
    return ray, si


def first_met(world: World, ray: mi.Ray3f, sampler: mi.Sampler,
              active: mi.Bool) -> tuple[mi.SurfaceInteraction3f, mi.Float]:
    """The first surface that is there on a camera's ray, and how far away it is."""
    if not world.coverage:
        si = world.scene.ray_intersect(ray, mi.RayFlags.All, coherent=True, active=active)
        return si, si.t
    _, si = first_surface(world.scene, ray, None, sampler.next_1d(active), active)
    return si, dr.select(si.is_valid(), dr.dot(si.p - ray.o, ray.d), dr.inf)


def _passed(si: mi.SurfaceInteraction3f, ray: mi.Ray3f, body: mi.ShapePtr | None, choice: mi.Float | None,
            active: mi.Bool) -> tuple[mi.Bool, mi.Float | None]:
    """Whether a ray goes on at what it meets, and what is left of the random number."""
    lamp = mi.Bool(False) if body is None else active & si.is_valid() & (si.shape != body)
    if choice is None:
        return lamp, None
    met = active & si.is_valid() & ~lamp
    share = coverage(si.bsdf(ray), si, met)
    gone = met & (choice >= share)
    rest = dr.minimum((choice - share) / (1 - share), dr.one_minus_epsilon(mi.Float))
    return lamp | gone, dr.select(gone, rest, choice)
