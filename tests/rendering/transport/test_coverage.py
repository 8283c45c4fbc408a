"""What is there in part: sight, light and masks past it, against values by hand and Mitsuba's own `mask`."""

import gc
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.rendering import passes
from dataset_builder.rendering.passes import FIRST_HIT_CHANNELS, RADIANCE_CHANNELS, ViewSensor
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.rendering.transport.fog import Fog
from tests.reference_scenes import SIZE, differ, diffuse, rectangle, rendered, sensor, shining, traced
from tests.small_scenes import ball, box, camera, light, lit_by, matte, render_plan, sheet

FEATURES = frozenset({"textures", "coverage"})
FRAME = np.arange(SIZE * SIZE)
WIDE = 200.0
SUN = light("sun", (3.0, 3.0, 3.0), direction=(0, 1, 0))


def leaf(alpha, albedo=0.5, **more):
    return Material(name="leaf", base_color=(albedo,) * 3, specular=0.0, alpha=alpha, **more)


def chess(cutoff=0.5, side=8):
    """Squares with holes between them."""
    holes = (np.indices((side, side)).sum(axis=0) % 2).astype(np.float32)
    texture = Texture(base_color=np.ones((side, side, 3), np.float32), alpha=holes, nearest=True)
    return leaf(1.0, alpha_cutoff=cutoff, texture=texture)


def look(soup, *lights, at=None, depth=2, spp=64, features=FEATURES):
    """Layer -> (means, errors), (P, C) each, and instances (P,)."""
    view = ViewSensor(camera=at or camera((0, -4, 0)), render=render_plan(SIZE, batches=8))
    with open_scene(body_of(soup, features=features), lit_by(*lights)) as opened:
        first = passes.first_hit(view, opened, FRAME, spp, 8, 9)
        found = passes.radiance(view, opened, FRAME, max_depth=depth, spp=spp, seed=5)
        instance = passes.instances(view, opened, FRAME)
    layers = {name: (first.mean[:, cut], first.error[:, cut]) for name, cut in FIRST_HIT_CHANNELS.items()}
    return layers | {name: (found.mean[:, cut], found.error[:, cut]) for name, cut in RADIANCE_CHANNELS.items()
                     if cut.stop <= found.mean.shape[1]}, instance


def sigmas(layer, expected):
    """How many standard errors the frame's mean is off; float32 may round by 1e-5."""
    mean, error = layer
    return (np.abs(mean.mean(axis=0) - expected) / (np.sqrt((error**2).mean(axis=0) / len(mean)) + 1e-5)).max()


def test_a_sheet_that_is_a_fifth_there():
    """Under a sky of 1, which is also what is behind it. One of these fails by chance once in 2,000 runs."""
    found, instance = look(sheet(leaf(0.2), 0, WIDE), light("dome"))
    for name, expected in (("mask", 0.2), ("met", 0.2), ("d", 0.2 * 0.5), ("image", 0.2 * 0.5 + 0.8),
                           ("shading", 0.2), ("specular", 0.8)):
        assert sigmas(found[name], expected) < 4, name
    assert not instance.any()


def test_of_two_sheets_one_is_seen_and_lit_through_the_other():
    """Only direct light: the second gets what the first lets through, 0.8."""
    both = merge([sheet(leaf(0.2), 0, WIDE), sheet(leaf(0.5, 0.25), 0.1, WIDE, instance=2)])
    found, instance = look(both, light("dome"))
    second = 0.8 * 0.5
    assert sigmas(found["mask"], 0.2) < 4 and sigmas(found["met"], 0.2 + second) < 4
    assert sigmas(found["shading"], 0.2 + second * 0.8) < 4
    assert sigmas(found["image"], 0.2 * 0.5 + second * 0.25 * 0.8 + (1 - 0.2 - second)) < 4
    # Half of the sight has ended at the second: 0.2 + 0.4 > 0.5
    assert (instance == 2).all()


def test_cut_outs_are_cut_from_every_layer_and_shadow():
    """Squares a metre wide before a wall, in the light of a sun behind the camera."""
    found, instance = look(merge([sheet(chess(), 0, 4), sheet(matte(), 1, 8, instance=2)]), SUN,
                           features=FEATURES | {"maps"}, at=camera((0, -20, 0), fov=20))
    x = (np.arange(SIZE) + 0.5 - SIZE / 2) / (SIZE / 2) * 20 * np.tan(np.radians(10))
    column, row = np.floor(x + 4).astype(int), np.floor(4 + x).astype(int)
    on = (np.abs(x)[:, None] < 4) & (np.abs(x) < 4) & ((row[:, None] + column) % 2 == 1)
    assert np.array_equal(instance.reshape(SIZE, SIZE), np.where(on, 1, 2))
    assert on.mean() == 0.5
    mask, shading = found["mask"][0].reshape(SIZE, SIZE), found["shading"][0][:, 0].reshape(SIZE, SIZE)
    whole = (mask == 0) | (mask == 1)
    assert whole.mean() > 0.2 and np.array_equal(mask[whole] == 1, on[whole])
    assert np.allclose(shading[mask == 1], 3 / np.pi, rtol=1e-4)
    # Shadows of squares fall behind squares, but for what the camera sees slantwise
    assert np.median(shading[mask == 0]) == pytest.approx(3 / np.pi, rel=1e-4)
    dark = look(merge([sheet(leaf(1.0), 0, 4), sheet(matte(), 1, 8, instance=2)]), SUN,
                at=camera((0, 0.5, 0), (0, 1, 0), fov=120))[0]["shading"][0]
    half = look(merge([sheet(chess(), 0, 4), sheet(matte(), 1, 8, instance=2)]), SUN, features=FEATURES | {"maps"},
                at=camera((0, 0.5, 0), (0, 1, 0), fov=120))[0]["shading"]
    assert dark.max() < 1e-6
    assert half[0].mean() == pytest.approx(1.5 / np.pi, rel=0.02)


def stage(body):
    """Two leaves over a floor in Mitsuba's plugins, each made by `body`."""
    lamp = rectangle((0.6, -0.5, 2.0), (-0.3, 0.25, -1), 0.5, bsdf=diffuse(0), emitter=shining(9, 8, 6))
    return mi.load_dict({"type": "scene", "lamp": lamp, "sky": {"type": "constant", "radiance": 0.3},
                         "floor": rectangle((0, 0, -1), (0, 0, 1), 4, bsdf=diffuse(0.5)),
                         **{f"leaf{k}": rectangle((0, 0, 0.4 * k), (0.2, 0, 1), 1.2, bsdf=body) for k in (0, 1)}})


def test_leaves_agree_with_mitsubas_mask():
    """Mitsuba's plugin under its own integrator against our surface under ours and under Mitsuba's."""
    theirs = stage({"type": "mask", "opacity": 0.4, "bsdf": {"type": "twosided", "bsdf": diffuse([0.7, 0.4, 0.2])}})
    paper = Material(name="leaf", base_color=(0.7, 0.4, 0.2), specular=0.0, alpha=0.4)
    soup = merge([*(tilted(paper, 0.4 * k) for k in (0, 1)), box(matte(), (-4, -4, -2), (4, 4, -1))])
    lights = (light("area", (9, 8, 6), position=(0.6, -0.5, 2.0), direction=(-0.3, 0.25, -1), size=1.0),
              light("dome", (0.3, 0.3, 0.3)))
    expected = rendered(theirs, sensor(), 128, "path", max_depth=-1, rr_depth=20)
    with open_scene(body_of(soup, features=FEATURES), lit_by(*lights)) as opened:
        ours = traced(opened.scene, sensor(), 64, 3, features=FEATURES, max_depth=20)
        own = rendered(opened.scene, sensor(), 64, "path", max_depth=-1, rr_depth=20)
    assert not differ(ours["image"], expected, 0.001 / 2)
    assert not differ(own, expected, 0.001 / 2)


def tilted(material, height):
    """A leaf of `stage`."""
    flat = sheet(material, 0.0, 1.2)
    to_world = np.array(mi.ScalarTransform4f().look_at([0, 0, height], [0.2, 0, height + 1], [1, 0, 0]).matrix)
    rotation, offset = to_world[:3, :3], to_world[:3, 3]
    # The sheet stands in x and z and looks along -y
    local = flat.corners[..., [0, 2, 1]]
    normal = np.broadcast_to(rotation @ (0, 0, 1), flat.normals.shape)
    return replace(flat, corners=local @ rotation.T + offset, normals=normal)


@pytest.mark.parametrize("fog", (False, True))
def test_i_is_d_s_spec_and_air_for_every_path(fog):
    soup = merge([sheet(leaf(0.5, 0.7), -0.8, 1.0), ball(matte((0.2, 0.2, 0.2)), radius=0.7, instance=2),
                  sheet(leaf(0.4, 0.4), 1.5, 3, instance=3)])
    air = Fog(0.2, 0.8, 0.3, (-5, -5, -5), (5, 5, 5)) if fog else None
    lights = light("area", (8, 8, 8), position=(1.5, -2, 2), direction=(-1.5, 2, -2), size=0.8), light("dome")
    with open_scene(body_of(soup, features=FEATURES), lit_by(*lights)) as opened:
        found = traced(opened.scene, sensor(), 1, 3, features=FEATURES, fog=air)
    rest, lit = found["image"] - found["specular"] - found["air"], found["shading"][..., 0] > 1e-3
    albedo = (rest / np.maximum(found["shading"], 1e-12))[..., 0][lit]
    nearest = np.abs(albedo[:, None] - np.array([0.7, 0.2, 0.4])).argmin(axis=1)
    assert np.allclose(albedo, np.array([0.7, 0.2, 0.4])[nearest], atol=5e-3)
    assert set(nearest) == {0, 1, 2}
    assert np.abs(rest[~lit]).max() < 1e-3


def test_alpha_that_leaves_all_there_needs_no_other_kernel():
    texture = Texture(base_color=np.ones((2, 2, 3), np.float32), alpha=np.ones((2, 2), np.float32))
    plain, kept = Texture(base_color=np.ones((2, 2, 3), np.float32)), []
    for material in (leaf(1.0, texture=plain), leaf(1.0, texture=texture, emission=(0, 0, 0)),
                     leaf(0.7, texture=texture, alpha_cutoff=0.6)):
        gc.collect()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            look(sheet(material, 0, 1), light("dome"), spp=8, features=frozenset({"textures"}))
            kept.append([kernel["hash"] for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000])
    assert kept[0] == kept[1] == kept[2] and len(kept[0]) == 2


def test_another_cut_out_needs_no_new_kernel():
    rng = np.random.default_rng(4)
    features = FEATURES | {"maps", "colours", "emission"}

    def render(side, half):
        maps = {name: rng.uniform(0, 1, (side, side)).astype(np.float32) for name in ("alpha", "coat")}
        texture = Texture(base_color=rng.uniform(0, 1, (side, side, 3)).astype(np.float32), **maps,
                          wrap=("clamp", "mirror"))
        leaves = leaf(half, emission=(half, 0, 1), alpha_cutoff=half / 2, texture=texture)
        colors = rng.uniform(0, 1, (2, 3, 4)).astype(np.float32)
        soup = merge([sheet(leaves, 0, half, colors=colors), ball(matte(), centre=(0, 2, 0), segments=side)])
        view = ViewSensor(camera=camera(), render=render_plan(SIZE))
        with open_scene(body_of(soup, features=features), lit_by(light("dome"))) as opened:
            passes.radiance(view, opened, FRAME, max_depth=4, spp=4, seed=1)

    gc.collect()
    render(8, 0.5)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        render(12, 0.9)
        big = [kernel for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000]
    assert len(big) == 1 and big[0]["cache_hit"]
