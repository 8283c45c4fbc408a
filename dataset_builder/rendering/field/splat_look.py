"""What rays see of Gaussian splats: blended front to back, as those who fit splats blend them.

Rays find splats through Mitsuba's `ellipsoids`, in the order in which they enter them; opacity along a ray is that of
the densest point (Moenne-Loccoz and others, "3D Gaussian Ray Tracing", SIGGRAPH Asia 2024), colour is that of the
direction from the ray's origin to the middle (Kerbl and others, "3D Gaussian Splatting", SIGGRAPH 2023). Rasterizers
sort by middles instead, so that pictures differ a little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_moves import turn_matrices
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.looks import Look

EXTENT = 3.0
"""Standard deviations at which a splat ends, those of KHR_gaussian_splatting."""
LEFT = 1e-3
"""Transmittance at which a ray ends; a tenth of it, as Kerbl and others have, costs a third more."""
FULLEST = 0.9999
"""Opacity of a splat at most, so that a ray never ends at one."""
THINNEST = 1e-3
"""Least scale of the hull that a splat is found by, in radii of the cloud: float32 places thinner ones badly. What it
looks like is that of its own scale."""
STEP = 1e-7
"""Radii that a ray goes on from where it entered a splat: what is entered within is lost."""
BACK = 0.02
"""Radii before the first splat from which a ray sets out: near ellipsoids are placed in all digits."""
NONE = 0xFFFFFFFF
"""No splat."""
MOST_HITS = 4096
"""Of a ray: a guard, far above what any ray needs that ends by its transmittance."""

Sight = Callable[["mi.Point3f", "mi.Vector3f", "mi.Bool"], "tuple[mi.Color3f, mi.Float, mi.Float]"]
"""As `Look`, and the distance in metres at which half of the light is blocked; 0 where less than half ever is."""


@dataclass(kw_only=True, eq=False)
class _Splats:
    """On the device, in a frame where the cloud fills the unit ball."""

    scene: mi.Scene
    centres: mi.Float
    whitening: mi.Float
    """(N, 9) from differences of points to standard deviations along each axis."""
    opacities: mi.Float
    harmonics: mi.Float
    degree: int


def splat_look(file: FieldFile) -> Look:
    """How rays see a field that is splats. One kernel serves all fields of a degree of harmonics.

    Splats whose colours are sRGB-encoded are blended encoded, since they were fitted so, and the blend is decoded
    before it is multiplied by its opacity again: what covers half of a pixel has the colour that it has where it covers
    all. The scene lives as long as the look; no other scene may be open meanwhile, see `rendering.scene.open_scene`.
    """
    assert file.splats is not None
    sight = splat_sight(file.splats, np.array(file.centre), file.radius)

    def look(origin: mi.Point3f, direction: mi.Vector3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
        colour, opacity, _ = sight(origin, direction, active)
        return colour, opacity

    return look


def splat_sight(cloud: SplatCloud, centre: np.ndarray, radius: float) -> Sight:
    """How rays see splats that lie within a ball, with depth."""
    splats = _upload(cloud, centre, radius)
    middle = mi.Point3f(*(dr.opaque(mi.Float, value) for value in centre.tolist()))
    unit, srgb = dr.opaque(mi.Float, radius), dr.opaque(mi.Bool, cloud.srgb)

    def sight(origin: mi.Point3f, direction: mi.Vector3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Float, mi.Float]:
        start = mi.Point3f((origin - middle) / unit)
        blend, opacity, depth = _blended(splats, start, mi.Vector3f(direction), active)
        straight = blend / dr.maximum(opacity, 1e-6)
        return dr.select(srgb, opacity * mi.math.srgb_to_linear(straight), blend), opacity, depth * unit

    return sight


def _upload(cloud: SplatCloud, centre: np.ndarray, radius: float) -> _Splats:
    centres = ((cloud.centres - centre) / radius).astype(np.float32)
    scales = cloud.scales.astype(np.float64) / radius
    hull = np.concatenate([centres, np.maximum(scales, THINNEST), np.roll(cloud.turns, -1, axis=1)], axis=1)
    data = mi.TensorXf(owned(mi.Float, hull.astype(np.float32)), hull.shape)
    scene = mi.load_dict({"type": "scene", "splats": {"type": "ellipsoids", "data": data, "extent": EXTENT}},
                         parallel=False)
    whitening = turn_matrices(cloud.turns).transpose(0, 2, 1) / scales[:, :, None]
    return _Splats(scene=scene, centres=owned(mi.Float, centres),
                   whitening=owned(mi.Float, whitening.astype(np.float32)), opacities=owned(mi.Float, cloud.opacities),
                   harmonics=owned(mi.Float, cloud.harmonics), degree=int(cloud.harmonics.shape[1]**0.5) - 1)


@dr.syntax
def _blended(splats: _Splats, origin: mi.Point3f, d: mi.Vector3f,
             active: mi.Bool) -> tuple[mi.Color3f, mi.Float, mi.Float]:
    """Colour as the splats have it, times opacity; opacity; depth; all in the unit frame."""
    half = -dr.dot(mi.Vector3f(origin), d)
    reach = 1 - dr.squared_norm(mi.Vector3f(origin) + half * d)
    across = dr.sqrt(dr.maximum(reach, 0))
    going = active & (reach > 0) & (half + across > 0)
    t = dr.maximum(half - across, 0)
    first = splats.scene.ray_intersect_preliminary(mi.Ray3f(origin + t * d, d), coherent=False, active=going)
    t = dr.maximum(dr.select(first.is_valid(), t + first.t - BACK, t), 0)
    light, through, depth = mi.Color3f(0), mi.Float(1), mi.Float(0)
    # Rounded, an ellipsoid may be entered again right behind where it was entered: the last two are not counted twice
    last, before = mi.UInt32(NONE), mi.UInt32(NONE)
    step, hits = mi.Float(STEP), mi.UInt32(0)
    while going:
        found = splats.scene.ray_intersect_preliminary(mi.Ray3f(origin + t * d, d), coherent=False, active=going)
        going &= found.is_valid()
        index = found.prim_index
        again = (index == last) | (index == before)
        counts = going & ~again
        peak, opacity = _peak(splats, index, origin, d, counts)
        after = through * (1 - opacity)
        light += (through - after) * _colour(splats, index, origin, counts)
        depth = dr.select(counts & (through > 0.5) & (after <= 0.5), peak, depth)
        through = after
        before = dr.select(counts, last, before)
        last = dr.select(counts, index, last)
        step = dr.select(again, 4 * step, STEP)
        t += found.t + step
        hits += 1
        going &= (through > LEFT) & (hits < MOST_HITS)
    return light, 1 - through, depth


def _peak(splats: _Splats, index: mi.UInt32, origin: mi.Point3f, d: mi.Vector3f,
          active: mi.Bool) -> tuple[mi.Float, mi.Float]:
    """Where a ray is nearest to the middle of a splat in its standard deviations, and its opacity there; 0 for rays
    that do not count."""
    offset = mi.Vector3f(origin - dr.gather(mi.Point3f, splats.centres, index, active))
    rows = [dr.gather(mi.Vector3f, splats.whitening, 3 * index + row, active) for row in range(3)]
    o, way = mi.Vector3f(*(dr.dot(row, offset) for row in rows)), mi.Vector3f(*(dr.dot(row, d) for row in rows))
    peak = -dr.dot(o, way) / dr.maximum(dr.squared_norm(way), 1e-20)
    near = dr.squared_norm(dr.cross(o, way)) / dr.maximum(dr.squared_norm(way), 1e-20)
    opacity = dr.gather(mi.Float, splats.opacities, index, active) * dr.exp(-0.5 * near)
    return peak, dr.select(active & (peak > 0), dr.minimum(opacity, FULLEST), 0)


def _colour(splats: _Splats, index: mi.UInt32, origin: mi.Point3f, active: mi.Bool) -> mi.Color3f:
    """Of a splat in the direction in which it is seen."""
    way = dr.normalize(mi.Vector3f(dr.gather(mi.Point3f, splats.centres, index, active) - origin))
    functions = dr.sh_eval(way, splats.degree)
    colour = mi.Color3f(0.5)
    for number, value in enumerate(functions):
        colour += value * dr.gather(mi.Color3f, splats.harmonics, len(functions) * index + number, active)
    return dr.maximum(colour, 0)
