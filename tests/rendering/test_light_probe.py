"""Light about an object as spherical harmonics: by hand, in an integrating sphere, and against Mitsuba's own paths."""

import gc
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from dataset_builder.geometry.harmonics import COUNT, basis
from dataset_builder.planning.plan import plan_example
from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE
from dataset_builder.rendering.examples import render_view
from dataset_builder.rendering.light_probe import lighting
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import clean, merge, surroundings
from dataset_builder.rendering.transport.fog import Fog
from dataset_builder.spec.load import load_dataset
from tests.small_scenes import ball, box, corner_of_a_room, light, lit_by, matte

MAX_DEPTH, RR_DEPTH = 5, 5
FAILURES = 0.001
AIR = dict(extinction=0.4, albedo=0.0, anisotropy=0.0, low=(-5, -5, -5), high=(5, 5, 5))
LAMPS = {
    "area": (light("area", (8, 7, 6), position=(1.0, -1.5, 2), direction=(-1, 1.5, -2), size=0.8),),
    "sphere and dome": (light("dome", (0.5, 0.6, 0.9), weight=1), light("sphere", (20, 18, 15), position=(0.5, -1, 2))),
}


def nothing():
    """As good as an empty scene: a black brick far below."""
    return box(matte((0, 0, 0)), (-0.5, -0.5, -200), (0.5, 0.5, -199))


def found(soup, *lights, fog=None, **values):
    """(9, 3) coefficients and their standard errors."""
    medium = Fog(**fog) if fog else None
    with open_scene(body_of(soup), lit_by(*lights), medium) as opened:
        got = lighting(opened, **({"max_depth": MAX_DEPTH, "rr_depth": RR_DEPTH, "seed": 3} | values))
    return got.mean.reshape(COUNT, 3), got.error.reshape(COUNT, 3)


def functions(direction):
    return np.array(basis(*(np.array(direction) / np.linalg.norm(direction))))[:, None]


def within(mean, error, expected, freedom=31):
    """Whether coefficients are what is expected; a correct estimate is not in `FAILURES` of all runs (Sidak)."""
    level = 1 - (1 - FAILURES) ** (1 / mean.size)
    rounding = 1e-5 * (1 + np.abs(expected))
    return bool(np.all(np.abs(mean - expected) <= stats.t.isf(level / 2, freedom) * error + rounding))


def test_an_even_sky_has_one_coefficient():
    mean, error = found(nothing(), light("dome", (1, 2, 0.5), weight=1))
    expected = np.zeros((COUNT, 3))
    expected[0] = np.sqrt(4 * np.pi) * np.array([1, 2, 0.5])
    assert within(mean, error, expected) and 0 < error[1:].max() < 0.02


def test_a_point_light_by_hand():
    """Intensity over squared distance, from one direction."""
    mean, _ = found(nothing(), light("point", (9, 6, 3), position=(1, 2, 3)), at=(0.5, 0, 0))
    offset = np.array([0.5, 2, 3])
    assert np.allclose(mean, functions(offset) * np.array([9, 6, 3]) / (offset @ offset), rtol=1e-5, atol=1e-6)


def test_a_sun_by_hand():
    mean, _ = found(nothing(), light("sun", (2, 3, 4), direction=(0.5, 0.6, -1)))
    assert np.allclose(mean, functions((-0.5, -0.6, 1)) * np.array([2, 3, 4]), rtol=1e-5, atol=1e-6)


def test_two_lights_add_up():
    lamps = light("point", (9, 6, 3), position=(1, 2, 3)), light("sun", (2, 3, 4), direction=(0, 0, -1))
    both, error = found(nothing(), *lamps)
    assert within(both, error, sum(found(nothing(), lamp)[0] for lamp in lamps))


def test_fog_takes_its_share():
    lamp = light("point", (9, 9, 9), position=(0, 0, 2))
    mean, error = found(nothing(), lamp, fog=AIR)
    assert within(mean, error, np.exp(-0.8) * found(nothing(), lamp)[0])


def test_fog_in_a_bright_sky_sends_back_what_it_takes():
    """A furnace: what white fog scatters away in one direction comes from others."""
    mean, error = found(nothing(), light("dome", weight=1), fog=AIR | {"albedo": 1.0, "anisotropy": 0.5},
                        max_depth=100, rr_depth=100)
    assert within(mean, error, np.sqrt(4 * np.pi) * np.eye(COUNT)[:, :1])


@pytest.mark.parametrize("max_depth", [2, 3, 5])
def test_an_integrating_sphere(max_depth):
    """A matte ball about a lamp in its middle is evenly bright: the lamp's irradiance times albedo, and again for each
    of the max_depth - 2 bounces that a path has room for; that the ball has facets is worth half a percent."""
    albedo, radius, place = 0.8, 2.0, np.array([0.3, -0.4, 0.8])
    mean, error = found(ball(matte((albedo,) * 3), radius=radius, segments=48), light("point", (4, 4, 4), position=(
        0, 0, 0)), at=place, max_depth=max_depth)
    albedo = float(np.float16(albedo))
    even = 4 / radius**2 / np.pi * sum(albedo**bounce for bounce in range(1, max_depth - 1))
    expected = functions(-place) * 4 / (place @ place) + np.sqrt(4 * np.pi) * even * np.eye(COUNT)[:, :1]
    assert within(mean, error + 5e-3 * even * (max_depth > 2), expected)
    assert max_depth == 2 or error.max() < 0.02 * even * np.sqrt(4 * np.pi)


@pytest.mark.parametrize("name", LAMPS)
def test_agrees_with_mitsubas_path_along_even_directions(name):
    """Welch's test of 27 coefficients: a correct estimate fails one of the two cases in a thousand runs (Sidak)."""
    room, place = corner_of_a_room(nothing()), (-0.3, 0.2, 0.1)
    ours = found(room, *LAMPS[name], at=place)
    theirs = _mitsubas(room, LAMPS[name], place)
    _, p = stats.ttest_ind_from_stats(ours[0], ours[1] * np.sqrt(32), 32, theirs.mean(axis=0),
                                      theirs.std(axis=0, ddof=1), len(theirs), equal_var=False)
    assert p.min() > 1 - (1 - FAILURES) ** (1 / (len(LAMPS) * p.size))
    assert theirs.mean(axis=0)[0].min() > 50 * ours[1][0].max()


def _mitsubas(soup, lights, place, batches=24, count=1 << 15):
    """(batches, 9, 3) coefficients by nothing but uniform directions; an edge to a camera is not counted here."""
    path = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH - 1, "rr_depth": RR_DEPTH})
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(11, batches * count)
    with open_scene(body_of(soup), lit_by(*lights)) as opened:
        direction = mi.warp.square_to_uniform_sphere(sampler.next_2d())
        colour, _, _ = path.sample(opened.scene, sampler, mi.Ray3f(mi.Point3f(*place), direction), None, True)
        radiance, ways = np.array(colour, dtype=float), np.array(direction, dtype=float)
    products = np.stack(basis(*ways))[:, None] * radiance
    return 4 * np.pi * np.moveaxis(products.reshape(COUNT, 3, batches, count).mean(axis=3), 2, 0)


def test_the_error_is_the_spread_of_repetitions():
    """Variance over 24 seeds against the mean of the squared errors: F distributed, about, so 1 in 1000 fails."""
    runs = [found(corner_of_a_room(nothing()), *LAMPS["area"], seed=seed, directions=4096) for seed in range(24)]
    ratio = np.var([mean for mean, _ in runs], axis=0, ddof=1).mean() / np.mean([error**2 for _, error in runs])
    low, high = stats.f.ppf([FAILURES / 2, 1 - FAILURES / 2], 23, 23 * 31)
    assert low < ratio < high


def test_repetition_gives_the_same_bits_and_another_seed_other_ones():
    scene = corner_of_a_room(nothing()), *LAMPS["area"]
    first, second, other = (found(*scene, seed=seed) for seed in (7, 7, 8))
    assert np.array_equal(first, second) and not np.array_equal(first, other)


def test_another_scene_needs_no_new_kernel():
    """Nor does it matter where NumPy puts what it is given: arrays that are held meanwhile move it about."""
    gc.collect()
    kernels, held = [], []
    for count in range(16):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            room = corner_of_a_room(ball(matte(), (0, 0, 5), segments=6 + count))
            found(room, *list(LAMPS.values())[count % 2], at=(0, 0.1, 0), max_depth=2 + count, directions=64)
            kernels += [kernel["hash"] for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000]
        held += [np.zeros(1, dtype=np.uint32) for _ in range(count)]
    assert len(kernels) == 16 and len(set(kernels)) == 1


# In the label

def planned(small_spec, index=1, layers=(("i_t", "object"),)):
    plan = plan_example(load_dataset(small_spec), index)
    return plan.model_copy(update={"render": plan.render.model_copy(update={"layers": layers})})


def rendered(*plans):
    return list(render_view(plans, Path()))


def test_the_label_is_in_world_axes_with_the_object_hidden(small_spec):
    """The same without any frame: surroundings in metres, from the middle of the object's box."""
    plan = planned(small_spec)
    example, = rendered(plan)
    corners = clean(plan.target, Path()).corners.reshape(-1, 3)
    room = surroundings(plan, Path())
    assert TARGET_INSTANCE not in room.instance
    mean, error = found(room, *plan.target_light.lights, at=(corners.min(axis=0) + corners.max(axis=0)) / 2,
                        max_depth=plan.effects.of("target").max_depth, rr_depth=plan.render.rr_depth, seed=99)
    recorded, errors = (np.array(getattr(example.record, name)) for name in ("lighting_sh", "lighting_sh_se"))
    assert within(recorded, np.hypot(error, errors), mean) and np.abs(mean[1:4]).max() > 20 * errors.max()
    assert not within(found(merge([room, clean(plan.target, Path())]), *plan.target_light.lights, at=np.add(
        corners.min(axis=0), corners.max(axis=0)) / 2)[0], errors, recorded)


def test_the_objects_own_looks_change_nothing(small_spec):
    plan = planned(small_spec, 8)
    target = plan.target.model_copy(update={"object": plan.target.object.model_copy(update={"seed": "5"})})
    assert np.array_equal(clean(plan.target, Path()).corners, clean(target, Path()).corners)
    one, = rendered(plan)
    other, = rendered(plan.model_copy(update={"target": target}))
    assert not np.array_equal(one.layers["i_t"], other.layers["i_t"])
    assert one.record.lighting_sh == other.record.lighting_sh


def test_once_per_light_and_the_same_whatever_came_before(small_spec):
    plans = [planned(small_spec, index, (("s_prime", "object"),)) for index in (0, 1, 2)]
    smooth, rough, other = rendered(*plans)
    assert smooth.record.lighting_sh == rough.record.lighting_sh != other.record.lighting_sh
    assert ["lighting" in example.seconds for example in (smooth, rough, other)] == [True, False, True]
    assert rendered(plans[2])[0].record.lighting_sh == other.record.lighting_sh


def test_where_no_layer_needs_the_target_light_there_are_zeros_of_the_same_kind(small_spec):
    without, = rendered(planned(small_spec, layers=(("i_s", "object"),)))
    for name in ("lighting_sh", "lighting_sh_se"):
        assert getattr(without.record, name) == ((0.0,) * 3,) * COUNT
        assert all(isinstance(value, float) for row in getattr(without.record, name) for value in row)
    assert "lighting" not in without.seconds
