"""Glass that spreads colours, by joined paths: against camera paths, and channel by channel against plain glass."""

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.passes import radiance_sampler
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.surface.channels_left import pack
from dataset_builder.rendering.transport.lamps import lamps_of
from dataset_builder.rendering.transport.light_paths import trace_light
from dataset_builder.rendering.transport.light_sampling import World
from dataset_builder.rendering.transport.path_tracer import PathStart, incident_radiance
from dataset_builder.rendering.view_sensor import ViewSensor
from tests.rendering.surface.test_glass import channel_indices
from tests.small_scenes import ball, camera, corner_of_a_room, light, lit_by, merge, render_plan

SIZE, BLOCK, SEEDS, DEPTH = 16, 8, 32, 12
IOR, ABBE = 1.6, 2.5
FEATURES = frozenset({"specular", "glass", "dispersion"})
LAMP = light("area", (8, 8, 8), position=(1.5, -2, 2), direction=(-1.5, 2, -2), size=1.6)
FAILURES = 0.001
"""Share of all runs in which a correct comparison fails, before blocks and channels are counted (Sidak)."""


def room(*, ior: float = IOR, abbe: float = ABBE):
    """A clear ball, and a frosted one beside it, on a floor between two walls."""
    clear = {"base_color": (0.95, 0.9, 0.85), "transmission": 1.0, "ior": ior, "abbe": abbe}
    frosted = ball(Material(name="frosted", roughness=0.4, **clear), (-1.2, -1.2, -0.5), 0.5, 3)
    return body_of(corner_of_a_room(merge([ball(Material(name="clear", roughness=0.0, **clear)), frosted])),
                   features=FEATURES)


@cache
def blocks(transport: str, caustics: bool, spp: int, ior: float = IOR, abbe: float = ABBE) -> np.ndarray:
    """(SEEDS, blocks, 6) means over blocks of pixels, of image and shading."""
    view = ViewSensor(camera=camera(), render=render_plan(SIZE))
    with open_scene(room(ior=ior, abbe=abbe), lit_by(LAMP)) as opened:
        sample = radiance_sampler(view, opened, DEPTH, transport, caustics)
        found = np.array([sample(np.arange(SIZE**2), spp, 4, seed).mean[:, :6] for seed in range(SEEDS)])
    cut = found.reshape(SEEDS, SIZE // BLOCK, BLOCK, SIZE // BLOCK, BLOCK, 6)
    return cut.mean(axis=(2, 4)).reshape(SEEDS, -1, 6)


def differ(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two sets of blocks have different expectations."""
    _, p = stats.ttest_ind(one, other, axis=0, equal_var=False)
    p = p[one.mean(axis=0) > 1e-3]
    assert p.size >= 4
    return bool(p.min() < 1 - (1 - FAILURES) ** (1 / p.size))


@pytest.mark.parametrize("caustics", [False, True])
def test_joined_paths_find_the_light_that_camera_paths_find(caustics: bool) -> None:
    assert not differ(blocks("joined", caustics, 64), blocks("camera", False, 144))


def test_every_channel_is_that_of_glass_with_its_own_index() -> None:
    """Caustics on: what the floor gets is found through light paths, which took one channel each."""
    spread, indices = blocks("joined", True, 64), channel_indices(IOR, ABBE)
    for channel in (0, 2):
        plain = blocks("joined", True, 64, float(indices[channel]), 0.0)
        own, other = [channel, channel + 3], [2 - channel, 5 - channel]
        assert not differ(spread[..., own], plain[..., own])
        assert differ(spread[..., other], plain[..., other])


def test_light_paths_keep_the_channel_that_glass_left_them() -> None:
    """Or else most would be left with nothing by the second crossing."""
    with open_scene(room(), lit_by(LAMP)) as opened:
        world = World(opened.scene, dr.opaque(mi.UInt32, DEPTH), dr.opaque(mi.UInt32, 5), FEATURES, None)
        found = trace_light(world, lamps_of(opened.scene, 4096), sets=1, seed=3)
    shown = (found.values[:, 6:9] > 0).sum(axis=1)
    assert np.isin(shown, (1, 3)).all() and 0.02 < (shown == 1).mean() < 0.9


def test_a_path_that_is_left_with_one_channel_keeps_to_it() -> None:
    lanes = 4096
    with open_scene(room(), lit_by(LAMP)) as opened:
        world = World(opened.scene, dr.opaque(mi.UInt32, DEPTH), dr.opaque(mi.UInt32, 5), FEATURES, None)
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(1, lanes)
        point = dr.zeros(mi.Interaction3f, lanes)
        point.p = mi.Point3f(0, -4, 1)
        lane = dr.arange(mi.UInt32, lanes) % 4
        channels = pack(mi.Color3f(*(dr.select((lane == 0) | (lane == 1 + each), mi.Float(1), 0) for each in range(3))))
        start = PathStart(point=point, direction=dr.normalize(mi.Vector3f(0, 4, -1)), pdf=mi.Float(1),
                          delta=mi.Bool(True), depth=mi.UInt32(1), prior_throughput=mi.Float(1), channels=channels,
                          inside=mi.UInt32(0))
        found = np.array(incident_radiance(world, sampler, start, mi.Bool(True))).T.reshape(-1, 4, 3)
    lit = found.mean(axis=0) > 0
    assert lit.tolist() == [[True] * 3, [True, False, False], [False, True, False], [False, False, True]]
    # The same light on average as where paths choose their channel themselves
    error = np.hypot(found.std(axis=0), found[:, :1].std(axis=0)) / np.sqrt(len(found))
    assert (np.abs(found.mean(axis=0) - found[:, 0].mean(axis=0)) < 4 * error + 1e-6)[lit].all()


def test_glass_that_is_hardly_rough_is_hardly_noisier_than_smooth_glass() -> None:
    """Its lobes are narrower than its colours are apart: a path that forgot its channel would lose it two times in
    three at every crossing, and make up for it with weights of up to three."""
    view, variance = ViewSensor(camera=camera(), render=render_plan(SIZE)), {}
    for roughness in (0.0, 0.04):
        flint = Material(name="flint", base_color=(0.95, 0.9, 0.85), roughness=roughness, transmission=1.0, ior=1.6,
                         abbe=35)
        body = body_of(corner_of_a_room(merge([ball(flint), ball(flint, radius=0.5)])), features=FEATURES)
        with open_scene(body, lit_by(light("dome"))) as opened:
            sample = radiance_sampler(view, opened, DEPTH, "camera", wanted=frozenset({"image"}))
            found = np.array([sample(np.arange(SIZE**2), 16, 4, seed).mean[:, :3] for seed in range(12)])
        variance[roughness] = found.var(axis=0, ddof=1).mean()
    assert variance[0.04] < 1.5 * variance[0.0]
