"""Surfaces that send out light: what they send by hand, and against lamps of the same radiance."""

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.rendering.surface.material_table import Textures
from tests.reference_scenes import differ, sensor, traced
from tests.rendering.transport.test_coverage import WIDE, look, sigmas
from tests.small_scenes import ball, box, camera, light, lit_by, matte, sheet

FEATURES = frozenset({"emission"})
WARM = (2.0, 1.0, 0.5)
DARK = light("dome", (1e-6, 1e-6, 1e-6))


def glowing(albedo=0.0, **more):
    return Material(**{"name": "glow", "base_color": (albedo,) * 3, "specular": 0.0, "emission": WARM, **more})


@pytest.mark.parametrize("side", (1, -1))
def test_a_glowing_sheet_by_hand(side):
    """I is its own radiance and what it reflects of a sky of 1; S is the sky's, its own light is in the rest. Both
    sides shine."""
    found, _ = look(sheet(glowing(0.5), 0, WIDE), light("dome"), at=camera((0, -4 * side, 0)), features=FEATURES)
    for name, expected in (("shading", 1.0), ("specular", WARM), ("image", np.array(WARM) + 0.5), ("d", 0.5)):
        assert sigmas(found[name], np.broadcast_to(expected, 3)) < 4, name


def test_what_is_there_in_part_shines_in_part():
    features = FEATURES | {"coverage"}
    found, _ = look(sheet(glowing(alpha=0.2), 0, WIDE), light("dome"), features=features)
    assert sigmas(found["image"], 0.2 * np.array(WARM) + 0.8) < 4
    # A white wall behind it that sees nothing else but the dome through it
    wall = sheet(matte((1, 1, 1)), 0.2, WIDE, instance=2)
    lit, _ = look(merge([sheet(glowing(alpha=0.2), 0, WIDE), wall]), light("dome"), features=features,
                  at=camera((0, 0.1, 0), (0, 0.2, 0)), spp=256)
    assert sigmas(lit["shading"], 0.2 * np.array(WARM) + 0.8) < 4


def test_the_unit_is_the_sky_and_texels_multiply():
    texels = np.zeros((2, 2, 3), np.float32)
    texels[0], texels[1] = (1, 0.5, 0), (0, 0.5, 1)
    texture = Texture(base_color=np.ones((2, 2, 3), np.float32), emission=texels, nearest=True)
    soup = sheet(glowing(texture=texture), 0, 1)
    features = frozenset({"textures", "maps", "emission"})
    with open_scene(body_of(soup, Textures.upload(soup.materials, sky=3.0), features), lit_by(DARK)) as opened:
        found = traced(opened.scene, sensor((0, -4, 0), fov=20), 4, 1, features=features)["image"].mean(axis=0)
    # Row 0 of an image is at v = 1, the upper half
    assert np.allclose(found[:7], 3 * np.array(WARM) * (1, 0.5, 0), rtol=1e-3, atol=1e-5)
    assert np.allclose(found[9:], 3 * np.array(WARM) * (0, 0.5, 1), rtol=1e-3, atol=1e-5)


def test_a_glowing_square_lights_as_a_lamp_of_its_radiance():
    """A square that shines on a ball and a floor, as a lamp and as a surface, which paths meet by chance."""
    lamp = light("area", tuple(4 * value for value in WARM), position=(0, -2, 0), direction=(0, 1, 0), size=3.0)
    stage = merge([ball(matte((0.7, 0.7, 0.7))), box(matte(), (-4, -4, -1.3), (4, 4, -1))])
    square = sheet(glowing(emission=lamp.radiance), -2, 1.5, instance=3)
    views = sensor((3, -1.5, 1.0)), 64
    with open_scene(body_of(stage, features=FEATURES), lit_by(lamp)) as opened:
        theirs = traced(opened.scene, *views, 3)
    with open_scene(body_of(merge([stage, square]), features=FEATURES), lit_by(DARK)) as opened:
        ours = traced(opened.scene, views[0], 256, 4, features=FEATURES)
    assert ours["image"].mean() > 0.1
    # Neither is in the picture, for a lamp shines to one side alone
    for name in ("image", "shading"):
        assert not differ(ours[name], theirs[name], 0.001 / 2)


@pytest.mark.parametrize("alpha", (1.0, 0.5))
def test_i_is_d_s_and_the_rest_for_every_path(alpha):
    features = FEATURES | {"coverage"}
    soup = merge([sheet(glowing(0.7, alpha=alpha), 0.2, 1.0), ball(matte((0.2, 0.2, 0.2)), (0, 1.5, 0), instance=2)])
    with open_scene(body_of(soup, features=features), lit_by(light("dome", (0.1, 0.1, 0.1)))) as opened:
        found = traced(opened.scene, sensor(), 1, 3, features=features)
    rest, lit = (found["image"] - found["specular"])[..., 0], found["shading"][..., 0] > 1e-3
    albedo = rest[lit] / found["shading"][..., 0][lit]
    assert np.minimum(np.abs(albedo - 0.7), np.abs(albedo - 0.2)).max() < 5e-3
    assert lit.mean() > 0.05 and found["specular"].max() > 1.9
