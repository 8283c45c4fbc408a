"""Light paths aimed at casters: they carry what lamps send, with the density that camera paths think they have."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.rendering.transport.aim import SHARE
from dataset_builder.rendering.transport.lamps import Beginning, Emission, Lamps, emit, lamps_of
from tests.reference_scenes import diffuse, rectangle, shining

PATHS = 1 << 16
BINS = 4
FAILURES = 0.001
"""How often one test fails by chance."""
PLACE, COLOUR = [0.5, 0.0, 2.0], [3.0, 2.0, 1.0]
INTENSITY = {"type": "rgb", "value": COLOUR}
KINDS = ("area", "sphere", "point", "spot")
CASTERS = {
    "none": [], "below": [(0.2, 0.1, 0.0, 0.5)], "narrow": [(0.2, 0.1, 0.0, 1e-4)],
    "behind": [(0.4, 0.0, 5.0, 0.5)], "around": [(0.4, 0.0, 2.2, 4.0)], "cut by the horizon": [(2.0, 0.0, 2.3, 0.6)],
    "several": [(0.2, 0.1, 0.0, 0.5), (1.5, 0.0, 0.5, 0.3), (0.2, 0.1, 0.3, 0.6), (0.4, 0.0, 2.2, 4.0)]}


def scene_of(kind: str) -> mi.Scene:
    """A scene of one lamp, which shines downwards if it is aimed."""
    down = mi.ScalarTransform4f().look_at(PLACE, [0.4, 0.1, 0], [0, 1, 0])
    lamp = {"area": rectangle(PLACE, (0.3, 0, -1), 0.4, bsdf=diffuse(0), emitter=shining(*COLOUR)),
            "sphere": {"type": "sphere", "center": PLACE, "radius": 0.3, "bsdf": diffuse(0),
                       "emitter": shining(*COLOUR)},
            "point": {"type": "point", "position": PLACE, "intensity": INTENSITY},
            "spot": {"type": "spot", "to_world": down, "cutoff_angle": 35, "intensity": INTENSITY}}[kind]
    return mi.load_dict({"type": "scene", "lamp": lamp})


def lamps(scene: mi.Scene, casters: str | None) -> Lamps:
    spheres = None if casters is None else np.array(CASTERS[casters], dtype=float).reshape(-1, 4)
    return lamps_of(scene, PATHS, spheres)


def sent(found: Lamps, seed: int) -> Emission:
    """`PATHS` paths by independent random numbers."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, PATHS)
    emission = emit(found, dr.zeros(mi.UInt32, PATHS), mi.Float(1), sampler.next_2d(), sampler.next_2d())
    dr.eval(emission)
    return emission


def flux(emission: Emission) -> np.ndarray:
    return np.array(emission.flux.x + dr.zeros(mi.Float, PATHS), dtype=np.float64)


def differ(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Whether means over the first axis differ by more than rounding; of equal ones `FAILURES` do (Sidak)."""
    means, errors = zip(*((each.mean(axis=0), each.var(axis=0) / len(each)) for each in (ours, theirs)), strict=True)
    gap, scale = np.abs(means[0] - means[1]), np.abs(means[0]) + np.abs(means[1])
    z = gap[gap > 1e-5 * scale] / np.sqrt(sum(errors))[gap > 1e-5 * scale]
    return bool((stats.norm.sf(z) * 2 < 1 - (1 - FAILURES) ** (1 / max(z.size, 1))).any())


def density(found: Lamps, begin: Beginning, direction: mi.Vector3f) -> np.ndarray:
    """p(y0) p(d) / cos, or p(d), as camera paths have it that come upon a lamp from `direction`."""
    point = dr.zeros(mi.Interaction3f, PATHS)
    point.p = begin.p + 2 * direction
    light = begin.seen_from(point.p)
    a = found.emitted(point, light, mi.Bool(True)) * dr.select(light.delta, dr.squared_norm(point.p - begin.p), 1)
    return np.array(a + dr.zeros(mi.Float, PATHS), dtype=np.float64)


def bins(direction: mi.Vector3f) -> np.ndarray:
    """(PATHS,) cell of each direction: by height, by azimuth, and whether within 0.3 of one towards the casters."""
    x, y, z = np.array(direction, dtype=np.float64)
    height = np.clip((z + 1) / 2 * BINS, 0, BINS - 1).astype(int)
    azimuth = np.clip((np.arctan2(y, x) / np.pi + 1) / 2 * BINS, 0, BINS - 1).astype(int)
    way = np.array([-0.3, 0.1, -2.0]) / np.linalg.norm([-0.3, 0.1, -2.0])
    near = (np.array([x, y, z]).T @ way > np.cos(0.3)).astype(int)
    return (height * BINS + azimuth) * 2 + near


@pytest.mark.parametrize("casters", CASTERS)
@pytest.mark.parametrize("kind", KINDS)
def test_paths_carry_what_the_lamp_sends(kind: str, casters: str) -> None:
    scene = scene_of(kind)
    assert not differ(flux(sent(lamps(scene, casters), 1)), flux(sent(lamps(scene, None), 2)))


@pytest.mark.parametrize("casters", CASTERS)
@pytest.mark.parametrize("kind", KINDS)
def test_camera_paths_know_the_density_of_a_light_path(kind: str, casters: str) -> None:
    """The same number, but where rounding moves a path over the rim of a sphere."""
    scene = scene_of(kind)
    found = lamps(scene, casters)
    emission = sent(found, 3)
    own, seen = np.array(emission.begin.a + dr.zeros(mi.Float, PATHS)), density(found, emission.begin, emission.ray.d)
    alive = flux(emission) > 0
    # Near the horizon the cosine is all rounding
    cos = np.abs(np.array(dr.dot(emission.begin.n, emission.ray.d)))
    alive &= (cos > 0.01) | (kind in ("point", "spot"))
    same = np.isclose(own[alive], seen[alive], rtol=2e-3)
    assert alive.sum() > PATHS / 4 and same.mean() > 0.998


@pytest.mark.parametrize("casters", ["none", "below", "cut by the horizon", "several"])
@pytest.mark.parametrize("kind", KINDS)
def test_directions_are_as_often_as_their_density_says(kind: str, casters: str) -> None:
    """Shares of cells of the sphere: of paths sent, and of the density over even directions."""
    scene = scene_of(kind)
    found = lamps(scene, casters)
    emission = sent(found, 4)
    begin = emission.begin
    even = mi.warp.square_to_uniform_sphere(random_square(5))
    a = density(found, begin, even)
    if kind in ("area", "sphere"):
        cos = np.array(dr.dot(begin.n, even))
        a *= np.maximum(cos, 0) * (0.64 if kind == "area" else 4 * np.pi * 0.09)
    elif kind == "spot":
        x, y, z = np.array(even, dtype=np.float64)
        axis = np.array([-0.1, 0.1, -2.0]) / np.linalg.norm([-0.1, 0.1, -2.0])
        a *= np.array([x, y, z]).T @ axis >= np.cos(np.radians(35))
    cells = np.eye(2 * BINS**2)
    expected = cells[bins(even)] * (4 * np.pi * a)[:, None]
    alive = flux(emission) > 0 if kind == "spot" else np.ones(PATHS, bool)
    drawn = cells[bins(emission.ray.d)] * alive[:, None]
    if kind in ("area", "sphere"):
        # Below the horizon there is no light, and no density is asked for
        drawn *= (np.array(dr.dot(begin.n, emission.ray.d)) > 0)[:, None]
    assert drawn.sum() > PATHS / 4
    assert not differ(drawn, expected)


def random_square(seed: int) -> mi.Point2f:
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, PATHS)
    return sampler.next_2d()


@pytest.mark.parametrize("kind", KINDS)
def test_half_of_the_paths_go_to_a_sphere_that_the_lamp_sees(kind: str) -> None:
    """All of a lamp but the far side of a ball sees it, and its own directions hardly ever meet it. None of these paths
    may count as one of the lamp's own, which would carry a million times as much."""
    x, y, z, radius = CASTERS["narrow"][0]
    scene = scene_of(kind)
    emission, usual = sent(lamps(scene, "narrow"), 6), flux(sent(lamps(scene, None), 6)).max()
    way = mi.Point3f(x, y, z) - emission.begin.p
    met = dr.norm(dr.cross(emission.ray.d, way)) < radius * 1.05
    meets = np.array(met & (dr.dot(emission.ray.d, way) > 0))
    expected = SHARE * (1 - 0.3 / 2.0224) / 2 if kind == "sphere" else SHARE
    assert abs(meets.mean() - expected) < 4 * (expected * (1 - expected) / PATHS) ** 0.5
    assert flux(emission)[meets].max() < 1e-4 * usual


@pytest.mark.parametrize("casters", ["none", "behind", "around"])
def test_what_a_lamp_cannot_be_aimed_at_changes_nothing(casters: str) -> None:
    """A sphere behind the lamp, one that it is in, or none."""
    scene = scene_of("area")
    ours, plain = sent(lamps(scene, casters), 7), sent(lamps(scene, None), 7)
    assert np.allclose(np.array(ours.ray.d), np.array(plain.ray.d), atol=1e-6)
    assert np.allclose(flux(ours), flux(plain), rtol=1e-5)


def test_a_spot_is_not_aimed_beside_its_beam() -> None:
    """The sphere is at 45 degrees to the axis, outside of a beam of 35."""
    scene = scene_of("spot")
    beside = lamps_of(scene, PATHS, np.array([[2.5, 0.0, 0.0, 0.2]]))
    assert np.allclose(np.array(sent(beside, 8).ray.d), np.array(sent(lamps(scene, None), 8).ray.d), atol=1e-6)
