"""Fog: its distances and directions by hand, light through it against Beer and Lambert and Mitsuba's `volpath`."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.rendering.transport.fog import Fog, RaySegment
from dataset_builder.rendering.transport.integrator import trace
from tests.reference_scenes import (
    BATCHES,
    NO_ROULETTE,
    deviates,
    differ,
    diffuse,
    rectangle,
    rendered,
    sensor,
    shining,
    traced,
)

LOW, HIGH = (-2.0, -2.5, -1.5), (2.0, 2.5, 2.5)


def fog_of(extinction=0.4, albedo=0.8, anisotropy=0.0, low=LOW, high=HIGH):
    return Fog(extinction, albedo, anisotropy, low, high)


def column(*values):
    return mi.Float(np.ravel(values).astype(np.float32))


def lamp(kind="area"):
    lamps = {"area": rectangle((0.6, -0.5, 2.0), (-0.3, 0.25, -1), 0.4, bsdf=diffuse(0), emitter=shining(12, 10, 7)),
             "point": {"type": "point", "position": [0.5, 0.3, 1.8], "intensity": {"type": "rgb", "value": [9, 8, 6]}},
             "outside": rectangle((0, 0, 4), (0, 0, -1), 0.8, bsdf=diffuse(0), emitter=shining(12, 10, 7)),
             "dome": {"type": "constant", "radiance": {"type": "rgb", "value": [0.9, 1.0, 1.2]}}}
    return {"lamp": lamps[kind]}


def scene_of(**entries):
    floor = rectangle((0, 0, -1), (0, 0, 1), 1.9, bsdf=diffuse([0.6, 0.5, 0.4]))
    ball = {"type": "sphere", "radius": 0.7, "bsdf": diffuse([0.7, 0.3, 0.2])}
    return mi.load_dict({"type": "scene", "floor": floor, "ball": ball, **entries})


def mitsubas(extinction, albedo, anisotropy):
    """The same fog as a medium of Mitsuba's, in a cube without a surface."""
    half, middle = (np.subtract(HIGH, LOW) / 2).tolist(), (np.add(HIGH, LOW) / 2).tolist()
    return {"fog": {"type": "cube", "bsdf": {"type": "null"},
                    "to_world": mi.ScalarTransform4f().translate(middle).scale(half),
                    "interior": {"type": "homogeneous", "sigma_t": extinction, "albedo": albedo,
                                 "phase": {"type": "hg", "g": anisotropy}}}}


# Distances


@pytest.mark.parametrize(("origin", "direction", "end", "near", "length"), [
    ((0, 0, 0), (1, 0, 0), np.inf, 0, 2), ((0, 0, 0), (1, 0, 0), 0.5, 0, 0.5), ((-4, 0, 0), (1, 0, 0), np.inf, 2, 4),
    ((-4, 0, 0), (1, 0, 0), 3, 2, 1), ((-4, 0, 0), (-1, 0, 0), np.inf, 0, 0), ((0, 9, 0), (1, 0, 0), np.inf, 0, 0),
    ((1.9, 0, 0), (0, 0, 1), np.inf, 0, 2.5), ((0, 0, 8.5), (0, 0.6, -0.8), np.inf, 7.5, 0),
    ((0, -4.5, 0), (0, 0.8, 0.6), np.inf, 2.5, 5 / 3)])
def test_what_of_a_ray_lies_in_the_box(origin, direction, end, near, length):
    segment = fog_of().segment(mi.Point3f(*origin), mi.Vector3f(*direction), mi.Float(end))
    assert segment.length[0] == pytest.approx(length, abs=1e-5)
    assert length == 0 or segment.near[0] == pytest.approx(near, abs=1e-5)


@pytest.mark.parametrize("extinction", [1e-6, 1e-3, 0.3, 20.0])
def test_collisions_are_as_far_as_beer_and_lambert_say(extinction):
    fog, sample = fog_of(extinction), (np.arange(1000) + 0.5) / 1000
    segment = RaySegment(near=column(0.25), length=column(2.0))
    distance, collided = (np.array(part) for part in fog.sample_distance(segment, column(sample)))
    assert distance == pytest.approx(0.25 - np.log1p(-sample) / extinction, rel=1e-4)
    assert np.array_equal(collided, distance < 2.25)
    lost = -np.expm1(-2 * extinction)
    assert fog.opacity(segment)[0] == pytest.approx(lost, rel=1e-5)
    assert fog.transmittance(segment)[0] == pytest.approx(1 - lost)
    within = np.array(fog.sample_distance_within(segment, column(sample)))
    assert within == pytest.approx(0.25 - np.log1p(-sample * lost) / extinction, rel=1e-4)


@pytest.mark.parametrize("g", [-0.9, -0.3, 0.0, 1e-4, 5e-3, 0.5, 0.95])
def test_scattering_follows_henyey_and_greenstein(g):
    fog, rng = fog_of(anisotropy=g), np.random.default_rng(7)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    share = 2 * np.pi * weights * np.array(fog.phase(column(nodes)))
    assert share.sum() == pytest.approx(1, abs=1e-3) and share @ nodes == pytest.approx(g, abs=1e-3)
    forward = np.array([0.36, -0.48, 0.8])
    samples = mi.Point2f(rng.random((2, 20000)).astype(np.float32))
    direction, density = fog.sample_phase(mi.Vector3f(*forward.tolist()), samples)
    cosine = forward @ np.array(direction)
    assert np.allclose(np.linalg.norm(np.array(direction), axis=0), 1, atol=1e-5)
    assert np.allclose(density, fog.phase(column(cosine)), rtol=2e-2)
    below = (1 - g * g) / (2 * g or 1) * ((1 + g * g - 2 * g * cosine) ** -0.5 - 1 / (1 + g))
    # One in a thousand right samplers fails each of these
    assert stats.kstest(below if abs(g) > 1e-3 else (1 + cosine) / 2, "uniform").pvalue > 1e-3


# Light


@pytest.mark.parametrize("place", ["inside", "outside"])
def test_a_black_fog_only_takes(place):
    """A ray of sun slants through the box to the floor, and the floor's light through it to the camera."""
    extinction, down = 0.3, np.array([0.0, 0.6, -0.8])
    sun = {"lamp": {"type": "directional", "direction": down.tolist(), "irradiance": {"type": "rgb", "value": 2.0}}}
    origin = np.array((0, -0.5, 1.0) if place == "inside" else (0, -0.5, 4.0))
    view = sensor(tuple(origin), (0.0, 1.2, -1.0), fov=0.1)
    bare = scene_of(**sun, ball={"type": "sphere", "center": [0, 0, -3]})
    found = traced(bare, view, 1, 3, fog=fog_of(extinction, 0.0), max_depth=2)
    arriving = 2 * 0.8 / np.pi * np.exp(-extinction * min(3.5 / 0.8, (1.2 + 2.5) / 0.6))
    assert np.allclose(found["shading"], arriving, rtol=5e-3)
    toward = np.array([0.0, 1.2, -1.0]) - origin
    inside = np.linalg.norm(toward) * min(1, 3.5 / -toward[2])
    assert np.allclose(found["image"], arriving * np.exp(-extinction * inside) * np.array([0.6, 0.5, 0.4]), rtol=1e-2)
    assert np.allclose(found["air"], found["image"] * (1 - np.exp(extinction * inside)), rtol=1e-2)


@pytest.mark.parametrize(("kind", "anisotropy", "depth"), [("area", 0.6, 16), ("point", 0.0, 16), ("outside", -0.4, 16),
                                                           ("dome", 0.6, 16), ("area", 0.0, 2), ("dome", 0.5, 3)])
def test_agrees_with_mitsubas_volpath(kind, anisotropy, depth):
    medium, view = (0.4, 0.8, anisotropy), sensor((0, -5.5, 1.5))
    found = traced(scene_of(**lamp(kind)), view, 32, 3, fog=fog_of(*medium), max_depth=depth)
    theirs = rendered(scene_of(**lamp(kind), **mitsubas(*medium)), view, 32, "volpathmis", max_depth=depth,
                      rr_depth=50)
    assert not differ(found["image"], theirs, 0.001 / 6)


@pytest.mark.parametrize("g", [0.0, 0.7])
def test_white_furnace(g):
    """Under a sky of radiance 1, fog that only scatters about a white ball is as bright as the sky."""
    ball = {"type": "sphere", "radius": 0.9, "bsdf": diffuse(1.0)}
    sky = {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}
    found = traced(mi.load_dict({"type": "scene", "ball": ball, "sky": sky}), sensor(), 64, 3, fog=fog_of(0.5, 1.0, g),
                   max_depth=NO_ROULETTE)
    mean = found["image"].mean(axis=(1, 2, 3))
    assert not deviates(mean, 1.0) and mean.std() / np.sqrt(BATCHES) < 0.005


@pytest.mark.parametrize("extinction", [0.1, 1.5])
def test_a_closed_room_takes_what_its_lamp_sends(extinction):
    """However thick the fog, as long as it takes nothing: the walls of a closed room absorb the power of the lamp."""
    albedo, radiance, half = 0.6, 5.0, 1.0
    power = np.pi * radiance * 4 * np.pi * 0.2**2
    walls = {f"wall{axis}{side}": rectangle(tuple(np.eye(3)[axis] * side * half), tuple(-np.eye(3)[axis] * side), half,
                                            bsdf=diffuse(albedo)) for axis in range(3) for side in (-1, 1)}
    lamp = {"type": "sphere", "center": [0.2, 0.3, 0.1], "radius": 0.2, "bsdf": diffuse(1.0),
            "emitter": shining(radiance, radiance, radiance)}
    scene = mi.load_dict({"type": "scene", **walls, "lamp": lamp})
    lighting = _lighting_of_walls(scene, half, 2000, fog_of(extinction, 1.0, 0.4))
    absorbed = np.pi * lighting * (1 - albedo) * 6 * (2 * half) ** 2
    assert not deviates(absorbed, power)
    assert absorbed.std() / np.sqrt(BATCHES) < 0.01 * power


def _lighting_of_walls(scene, half, points, fog):
    """(BATCHES,) means of S over the walls of a cube about the origin."""
    rng, count = np.random.default_rng(3), BATCHES * 6 * points
    axis, side = np.tile(np.arange(3), count // 3), np.repeat([1.0, -1.0], count // 2)
    at = rng.uniform(-half, half, (count, 3))
    at[np.arange(count), axis] = 0.9 * half * side
    toward = np.eye(3)[axis] * side[:, None]
    ray = mi.Ray3f(mi.Point3f(at.T.astype(np.float32)), mi.Vector3f(toward.T.astype(np.float32)))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(5, count)
    found = trace(scene, sampler, sampler, ray, dr.opaque(mi.UInt32, 200), dr.opaque(mi.UInt32, 8), fog=fog)
    shuffled = np.random.default_rng(4).permutation(np.array(found.shading)[0])
    return shuffled.reshape(BATCHES, -1).mean(axis=1)


@pytest.mark.parametrize("kind", ["area", "dome"])
def test_image_is_its_parts_to_rounding(kind):
    found = traced(scene_of(**lamp(kind)), sensor(), 1, 3, fog=fog_of(), max_depth=4)
    surface = found["image"] - found["air"]
    # One sample per pixel and batch: D is 0 where a ray meets nothing or a lamp
    off = [np.abs(surface - np.array(d) * found["shading"] - found["specular"])
           for d in ([0.6, 0.5, 0.4], [0.7, 0.3, 0.2], [0, 0, 0])]
    assert np.min([part.max(axis=-1) for part in off], axis=0).max() < 1e-5 * found["image"].max()
    assert (found["air"] < 0).any() and (found["air"] > 0).any()


def test_no_extinction_is_clear_air():
    clear = traced(scene_of(**lamp()), sensor(), 64, 3)["image"]
    thin = traced(scene_of(**lamp()), sensor(), 64, 3, fog=fog_of(0.0))
    assert not thin["air"].any() and not differ(thin["image"], clear)
    assert differ(traced(scene_of(**lamp()), sensor(), 64, 3, fog=fog_of(0.4))["image"], clear)


def test_fog_about_glass_and_panes_agrees_with_mitsubas_volpath():
    pane = rectangle((0, 0, 1.2), (0, 0, 1), 0.9, bsdf={"type": "thindielectric", "int_ior": 1.5})
    medium, view = (0.3, 0.9, 0.3), sensor((0, -5.5, 1.5))
    found = traced(scene_of(pane=pane, **lamp()), view, 32, 3, fog=fog_of(*medium), features=["thin"], max_depth=24)
    theirs = rendered(scene_of(pane=pane, **lamp(), **mitsubas(*medium)), view, 32, "volpath", max_depth=-1,
                      rr_depth=50)
    assert not differ(found["image"], theirs)


def test_another_fog_needs_no_new_kernel():
    import gc

    def look(*fog):
        gc.collect()
        traced(scene_of(**lamp()), sensor(), 1, 3, fog=fog_of(*fog))

    look(0.4, 0.8, 0.0)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        look(0.1, 0.5, 0.7, (-3, -3, -3), (4, 4, 4))
        big = [kernel for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000]
    assert len(big) == 1 and big[0]["cache_hit"]
