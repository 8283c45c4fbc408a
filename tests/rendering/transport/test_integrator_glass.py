"""Glass and thin panes: the integrator against Mitsuba's own path tracer, and against transmittances by hand."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from tests.reference_scenes import (
    NO_ROULETTE,
    differ,
    diffuse,
    rectangle,
    rendered,
    sensor,
    shining,
    traced,
)

DEPTH = 12
THIN = {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0}


def lamp():
    return {"lamp": rectangle((0.6, -0.5, 2.0), (-0.3, 0.25, -1), 0.5, bsdf=diffuse(0), emitter=shining(9, 8, 6))}


def sky():
    rows = np.linspace(0.05, 1.0, 16)[:, None, None] * np.linspace(0.2, 1.5, 32)[None, :, None] * [1.0, 0.8, 0.6]
    return {"sky": {"type": "envmap", "bitmap": mi.Bitmap(rows.astype(np.float32))}}


def scene_of(*bodies, **lights):
    named = {f"body{index}": body for index, body in enumerate(bodies)}
    return mi.load_dict({"type": "scene", "floor": rectangle((0, 0, -1), (0, 0, 1), 4, bsdf=diffuse([0.6, 0.5, 0.4])),
                         **named, **lights})


def ball(bsdf):
    return {"type": "sphere", "radius": 0.9, "bsdf": bsdf}


BALLS = {"clear": {"type": "dielectric", "int_ior": 1.5},
         "rough": {"type": "roughdielectric", "int_ior": 1.5, "alpha": 0.3, "distribution": "ggx"}}


@pytest.mark.parametrize("glass", BALLS)
@pytest.mark.parametrize("light", ["lamp", "sky"])
def test_a_glass_ball_agrees_with_mitsubas_path(glass, light):
    scene, view = scene_of(ball(BALLS[glass]), **(lamp() if light == "lamp" else sky())), sensor()
    found = traced(scene, view, 256, 3, features=["glass"], max_depth=DEPTH)
    assert not differ(found["image"], rendered(scene, view, 256, "path", max_depth=DEPTH, rr_depth=5), 0.001 / 4)


def test_without_the_feature_a_clear_ball_is_not_seen_through():
    scene, view = scene_of(ball(BALLS["clear"]), **sky()), sensor()
    plain = traced(scene, view, 16, 3, max_depth=DEPTH)["image"]
    assert differ(plain, traced(scene, view, 16, 3, features=["glass"], max_depth=DEPTH)["image"])


def pane(height=0.0, half=1.6, bsdf=None):
    return rectangle((0, 0, height), (0, 0, 1), half, bsdf=bsdf or THIN)


def test_a_lamp_behind_a_pane_agrees_with_mitsubas_path():
    """Where Mitsuba meets the lamp by chance only, we also sample it through the pane."""
    scene, view = scene_of(pane(), **lamp()), sensor((0, -3.2, -0.4), (0, 0, -0.9))
    found = traced(scene, view, 64, 3, features=["thin"], max_depth=DEPTH)["image"]
    path = rendered(scene, view, 1024, "path", max_depth=-1, rr_depth=NO_ROULETTE)
    assert not differ(found, path)
    assert found.std(axis=0).mean() < path.std(axis=0).mean()
    assert differ(traced(scene, view, 64, 3, max_depth=DEPTH)["image"], found[:, ::-1])


def test_looking_through_a_pane_agrees_with_mitsubas_path():
    upright = rectangle((0, -2, 0.5), (0, -1, 0.2), 1.5, bsdf=THIN)
    scene, view = scene_of(upright, ball(diffuse([0.7, 0.3, 0.2])), **lamp()), sensor()
    found = traced(scene, view, 256, 3, features=["thin"], max_depth=4 * DEPTH)
    assert not differ(found["image"], rendered(scene, view, 512, "path", max_depth=-1, rr_depth=NO_ROULETTE))
    # The pane is the first surface, and has no diffuse lobe
    assert np.allclose(found["image"], found["specular"], rtol=1e-5)
    assert np.median(found["shading"]) > 0


@pytest.mark.parametrize("panes", [1, 2])
def test_a_pane_takes_what_its_two_faces_reflect(panes):
    """At normal incidence a face of index 1.5 reflects R = 0.04, two of them 2 R / (1 + R)."""
    sun = {"sun": {"type": "directional", "direction": [0, 0, -1], "irradiance": {"type": "rgb", "value": 3.0}}}
    scene = scene_of(*(pane(0.1 * i, 3) for i in range(panes)), **sun)
    found = traced(scene, sensor((0, -1, -0.2), (0, 0, -1)), 1, 3, features=["thin"], max_depth=2)["shading"]
    assert np.allclose(found, 3 / np.pi * (1 - 2 * 0.04 / 1.04) ** panes, rtol=1e-4)


@pytest.mark.parametrize("depth", [2, 3])
def test_panes_that_do_nothing_change_nothing_and_count_for_nothing(depth):
    """Panes between a floor and what lights it: a lamp, or at depth 3 a ceiling that a lamp shines up at."""
    ceiling = {"ceiling": rectangle((0, 0, 2.5), (0, 0, -1), 4, bsdf=diffuse(0.8)),
               "lamp": rectangle((0.3, 0, 1.0), (0, 0, 1), 0.4, bsdf=diffuse(0), emitter=shining(9, 8, 6))}

    def shading(*panes, spp):
        scene, view = scene_of(*panes, **(lamp() if depth == 2 else ceiling)), sensor((0, -1.5, -0.2), (0, 0, -1))
        return traced(scene, view, spp, 3, features=["thin"], max_depth=depth)["shading"]

    nothing = [pane(height, 3, {"type": "null"}) for height in (0.0, 0.2)]
    bare = shading(spp=64)
    assert not differ(shading(*nothing, spp=64), bare)
    assert differ(shading(pane(0.1, 3, diffuse(0)), spp=64), bare)


@pytest.mark.parametrize("features", [["glass"], ["thin"], ["glass", "thin"]])
def test_the_specular_part_is_what_diffuse_leaves(features):
    body = ball(BALLS["clear"] if "glass" in features else diffuse([0.7, 0.3, 0.2]))
    scene, view = scene_of(body, *([pane(1.2)] if "thin" in features else []), **lamp()), sensor()
    found = traced(scene, view, 1, 3, features=features)
    # Glass has no diffuse lobe; there is one sample per pixel and batch, so D is that of the path
    ratio = (found["image"] - found["specular"]) / np.maximum(found["shading"], 1e-12)
    lit = found["shading"] > 1e-3
    expected = np.array([[0.6, 0.5, 0.4], [0.7, 0.3, 0.2], [0.0, 0.0, 0.0]])
    distance = np.abs(ratio[..., None, :] - expected).max(axis=-1).min(axis=-1)
    assert lit.mean() > 0.1
    assert distance[lit.all(axis=-1)].max() < 1e-2
    assert not found["air"].any()


def test_another_pane_needs_no_new_kernel():
    def look(index, height):
        import gc

        gc.collect()
        own = mi.load_dict({"type": "thindielectric", "int_ior": index})
        dr.make_opaque(mi.traverse(own))
        traced(scene_of(pane(height, bsdf=own), **lamp()), sensor(), 1, 3, features=["thin", "glass"])

    look(1.5, 0.0)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        look(1.5, 0.3)
        big = [kernel for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000]
    assert len(big) == 1 and big[0]["cache_hit"]


MATERIALS = {
    "clear": {"transmission": 1.0, "roughness": 0.0, "ior": 1.5},
    "frosted": {"transmission": 1.0, "roughness": 0.5, "ior": 1.4},
    "milky": {"transmission": 0.5, "roughness": 0.0, "ior": 1.5, "base_color": (0.8, 0.5, 0.3)},
    "pane": {"transmission": 0.9, "roughness": 0.0, "ior": 1.5, "thin": True},
}


@pytest.mark.parametrize("name", MATERIALS)
def test_surfaces_that_transmit_agree_with_mitsubas_path(name):
    """Our own surface under both integrators; Mitsuba counts the panes that light passes as edges."""
    from tests import small_scenes

    material = Material(**{"name": name, "base_color": (1.0, 1.0, 1.0), **MATERIALS[name]})
    features = frozenset({"textures", "specular", "glass", "thin"})
    body = body_of(small_scenes.corner_of_a_room(small_scenes.ball(material)), features=features)
    lights = [small_scenes.light("area", (8, 8, 8), position=(1.5, -2, 2), direction=(-1.5, 2, -2), size=0.8),
              small_scenes.light("dome", (0.3, 0.4, 0.5), weight=1.0)]
    with open_scene(body, small_scenes.lit_by(*lights)) as opened:
        found = traced(opened.scene, sensor(), 64, 3, features=features, max_depth=3 * DEPTH)
        theirs = rendered(opened.scene, sensor(), 64, "path", max_depth=-1, rr_depth=20)
    assert not differ(found["image"], theirs, 0.001 / len(MATERIALS))
    assert found["specular"].mean() > 0.1 * found["image"].mean()
