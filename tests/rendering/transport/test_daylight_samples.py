"""Light samples through portals against those all round: the same expectations, whatever the portals, at less noise."""

import gc

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.label.scene_plan import PortalPlan
from dataset_builder.rendering import passes
from dataset_builder.rendering.passes import RADIANCE_CHANNELS, ViewSensor
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.rendering.transport import path_tracer
from dataset_builder.rendering.transport.fog import Fog
from dataset_builder.rendering.transport.portals import Portals
from tests.reference_scenes import differ, diffuse, rectangle, sensor, traced
from tests.small_scenes import ball, box, camera, light, lit_by, matte, render_plan

WINDOW = PortalPlan(corner=(-0.8, 2.1, -0.2), right=(1.6, 0, 0), up=(0, 0, 1.2))
HALF = PortalPlan(corner=(-0.8, 2.1, -0.2), right=(0.8, 0, 0), up=(0, 0, 1.2))
TOP = PortalPlan(corner=(2, -2, 2), right=(-4, 0, 0), up=(0, 4, 0))
ASIDE = PortalPlan(corner=(-2.1, -1, 0), right=(0, 1, 0), up=(0, 0, 1))
"""The hole in the room's wall, half of it, the hole that a missing ceiling leaves, and a place where there is none."""
WALLS = {"floor": ((-2, -2, -1.1), (2, 2, -1)), "back": ((-2, -2.1, -1), (2, -2, 2)),
         "left": ((-2.1, -2, -1), (-2, 2, 2)), "right": ((2, -2, -1), (2.1, 2, 2)),
         "below": ((-2, 2, -1), (2, 2.1, -0.2)), "above": ((-2, 2, 1), (2, 2.1, 2)),
         "before": ((-2, 2, -0.2), (-0.8, 2.1, 1)), "after": ((0.8, 2, -0.2), (2, 2.1, 1))}
CEILING = {"ceiling": ((-2.1, -2.1, 2), (2.1, 2.1, 2.1))}
LAMP = {"lamp": {"type": "point", "position": [1.0, -1.0, 1.5], "intensity": {"type": "rgb", "value": [0.2, 0.3, 0.1]}}}
INSIDE, OUTSIDE = ((1.2, -1.6, 0.8), (-0.6, 1.0, -0.4)), ((0.5, 5.5, 1.0), (0.0, 1.0, 0.2))
"""Cameras: in the room, and before the house, with things inside and outside in the picture."""
SPP, DEPTH = 256, 6
CASES = {
    "even": ((WINDOW,), {}, INSIDE), "image": ((WINDOW,), {}, INSIDE), "half": ((HALF,), {}, INSIDE),
    "twice": ((WINDOW, HALF), {}, INSIDE), "nowhere": ((ASIDE,), {}, INSIDE), "open top": ((WINDOW, TOP), {}, INSIDE),
    "glazed": ((WINDOW,), {"features": ["thin"]}, INSIDE), "fog": ((WINDOW,), {"fog": True}, INSIDE),
    "with a lamp": ((WINDOW,), {}, INSIDE), "from outside": ((WINDOW,), {}, OUTSIDE),
}


def cuboid(low, high, bsdf):
    middle, half = (np.array(low) + high) / 2, (np.array(high) - low) / 2
    return {"type": "cube", "bsdf": bsdf,
            "to_world": mi.ScalarTransform4f().translate(list(middle)) @ mi.ScalarTransform4f().scale(list(half))}


def sky():
    """Bright in a patch that the window faces."""
    texels = np.full((32, 64, 3), 0.4, dtype=np.float32) * [0.6, 0.8, 1.0]
    texels[8:14, 12:22] = [9.0, 7.0, 4.0]
    return {"type": "envmap", "bitmap": mi.Bitmap(texels.astype(np.float32))}


def room(name):
    parts = WALLS if name == "open top" else WALLS | CEILING
    bodies = {key: cuboid(*corners, diffuse([0.7, 0.6, 0.5])) for key, corners in parts.items()}
    pane = rectangle((0, 2.05, 0.4), (0, -1, 0), 1.0, bsdf={"type": "thindielectric", "int_ior": 1.5})
    more = {"glazed": {"pane": pane}, "with a lamp": LAMP}.get(name, {})
    dome = sky() if name == "image" else {"type": "constant", "radiance": 1.0}
    return mi.load_dict({"type": "scene", **bodies, **more, "dome": dome,
                         "ball": {"type": "sphere", "center": [-0.3, 0.8, -0.5], "radius": 0.5, "bsdf": diffuse(0.8)},
                         "stone": {"type": "sphere", "center": [0.6, 3.0, -0.3], "radius": 0.4, "bsdf": diffuse(0.4)}})


def both(name, share=0.1, spp=SPP):
    """Layers with portals and without."""
    portals, more, eye = CASES[name]
    fog = Fog(0.3, 0.9, 0.4, (-3, -3, -1), (3, 4, 2)) if more.get("fog") else None
    scene, view = room(name), sensor(*eye, fov=70)
    return [traced(scene, view, spp, seed, features=more.get("features", ()), fog=fog, portals=own, max_depth=DEPTH)
            for seed, own in ((3, Portals(portals, share)), (4, None))]


@pytest.mark.parametrize("name", CASES)
def test_portals_change_no_expectation(name):
    """Sidak: with nothing wrong, one of these twenty comparisons fails in a thousand runs."""
    found, expected = both(name)
    for layer in ("image", "shading"):
        assert not differ(found[layer], expected[layer], 0.001 / (2 * len(CASES))), layer
    if name in ("even", "glazed", "open top"):
        assert np.median(found["image"].var(axis=0)) < 0.5 * np.median(expected["image"].var(axis=0))


@pytest.mark.parametrize("share", [0.01, 0.5, 1.0])
def test_the_share_that_goes_all_round_changes_no_expectation(share):
    found, expected = both("half", share)
    assert not differ(found["image"], expected["image"], 0.001 / 3)


def test_a_density_that_knows_no_portals_would_be_found(monkeypatch):
    monkeypatch.setattr(path_tracer, "emitter_pdf",
                        lambda world, point, ds, active: world.scene.pdf_emitter_direction(point, ds, active))
    found, expected = both("even")
    assert differ(found["image"], expected["image"])


def stage(size=32):
    return ViewSensor(camera=camera(), render=render_plan(size))


def test_furnace():
    """A white ball under a dome of 1 is as bright as the dome, with portals beside and across it. Fails by chance once
    in 30,000 runs."""
    pixels = np.arange(32 * 32).reshape(32, 32)[12:20, 12:20].ravel()
    portals = (TOP, PortalPlan(corner=(-3, 0, -3), right=(6, 0, 0), up=(0, 0, 6)))
    with open_scene(body_of(ball(matte((1, 1, 1)))), lit_by(light("dome")), portals=portals) as opened:
        assert opened.portals is not None
        found = passes.radiance(stage(), opened, pixels, max_depth=6, spp=256, seed=5)
    for name in ("image", "shading"):
        cut = RADIANCE_CHANNELS[name]
        mean, error = found.mean[:, cut], found.error[:, cut]
        assert abs(mean.mean() - 1) < 4 * np.sqrt(np.mean(error**2) / len(pixels)) < 0.02


def test_any_number_of_portals_is_one_kernel_and_none_is_that_of_before():
    def hashes(*portals, dome=1.0):
        gc.collect()
        soup = merge([ball(matte()), *(box(matte(), low, high) for low, high in WALLS.values())])
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            lights = lit_by(light("dome", (dome,) * 3), light("area"))
            with open_scene(body_of(soup), lights, portals=portals) as opened:
                passes.radiance(stage(), opened, np.arange(32), max_depth=4, spp=4, seed=1)
            return [kernel["hash"] for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000]

    one, three, none = hashes(WINDOW), hashes(WINDOW, HALF, TOP, dome=2.0), hashes()
    assert len(one) == 1 and one == three
    assert none != one
