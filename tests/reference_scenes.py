"""Scenes of Mitsuba's own plugins, traced by us and by its own integrators, for tests that compare the two."""

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import stats

from dataset_builder.rendering.transport.integrator import trace

SIZE, BATCHES = 16, 8
BLOCK = 8
NO_ROULETTE = 1000


def sensor(origin=(0.0, -4.0, 1.2), target=(0.0, 0.0, 0.0), fov=40.0):
    """A camera with a square frame."""
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    return mi.load_dict({"type": "perspective", "fov": fov, "film": film,
                         "to_world": mi.ScalarTransform4f().look_at(origin, target, [0, 0, 1])})


def rectangle(centre, normal, half, **more):
    """A square of half side `half`; `more` are its bsdf or emitter."""
    up = [1, 0, 0] if abs(normal[2]) > 0.9 else [0, 0, 1]
    facing = mi.ScalarTransform4f().look_at(list(centre), [a + b for a, b in zip(centre, normal, strict=True)], up)
    return {"type": "rectangle", "to_world": facing @ mi.ScalarTransform4f().scale([half, half, 1]), **more}


def diffuse(value):
    """A Lambertian BSDF."""
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": [value] * 3 if np.isscalar(value) else value}}


def shining(*radiance):
    """An area emitter."""
    return {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}


def traced(scene, view, spp, seed, *, features=(), fog=None, portals=None, max_depth=8, rr_depth=5):
    """Our layers: name -> (BATCHES, SIZE, SIZE, 3) means of `spp` samples each."""
    lanes = BATCHES * SIZE * SIZE * spp
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, lanes)
    pixel = (dr.arange(mi.UInt32, lanes) // spp) % (SIZE * SIZE)
    corner = mi.Vector2f(mi.Float(pixel % SIZE), mi.Float(pixel // SIZE))
    ray, _ = view.sample_ray(0, 0.5, (corner + sampler.next_2d()) / SIZE, mi.Point2f(0.5), True)
    longest, roulette = (dr.opaque(mi.UInt32, depth) for depth in (max_depth, rr_depth))
    found = trace(scene, sampler, sampler, ray, longest, roulette, features=frozenset(features), fog=fog,
                  portals=portals)
    names = ("image", "shading", "specular", "air")
    parts = {name: getattr(found, name) + dr.zeros(mi.Color3f, lanes) for name in names}
    dr.eval(parts)
    return {name: _means(part, spp) for name, part in parts.items()}


def _means(colour, spp):
    return np.moveaxis(np.array(colour, dtype=np.float64), 0, -1).reshape(BATCHES, SIZE, SIZE, spp, 3).mean(axis=3)


def rendered(scene, view, spp, integrator, **more):
    """Mitsuba's image: (BATCHES, SIZE, SIZE, 3) of `spp` samples each."""
    plugin = mi.load_dict({"type": integrator, **more})
    return np.array([np.array(mi.render(scene, integrator=plugin, sensor=view, spp=spp, seed=seed))
                     for seed in range(100, 100 + BATCHES)], dtype=np.float64)


def blocks(images):
    """Means over blocks of pixels: (BATCHES, blocks, 3)."""
    cut = images.reshape(BATCHES, SIZE // BLOCK, BLOCK, SIZE // BLOCK, BLOCK, 3)
    return cut.mean(axis=(2, 4)).reshape(BATCHES, -1, 3)


def differ(ours, theirs, failures=0.001):
    """Whether two sets of images have different expectations; true for equal ones in `failures` of all runs (Sidak)."""
    _, p = stats.ttest_ind(blocks(ours), blocks(theirs), axis=0, equal_var=False)
    p = p[np.isfinite(p)]
    assert p.size
    return bool(p.min() < 1 - (1 - failures) ** (1 / p.size))


def deviates(found, expected, failures=0.001):
    """Whether (BATCHES, ...) means of independent batches deviate from what is expected, as `differ` does."""
    _, p = stats.ttest_1samp(found.reshape(BATCHES, -1), np.ravel(expected), axis=0)
    p = p[np.isfinite(p)]
    assert p.size
    return bool(p.min() < 1 - (1 - failures) ** (1 / p.size))
