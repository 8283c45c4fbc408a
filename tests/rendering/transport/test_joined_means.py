"""Joined paths against camera paths: equal expectations, pixel blocks and frame, image, shading and specular part.

Each case fails by chance in one of 20,000 runs, all of them together in one of 500.
"""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.digest import sha256_file
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.rendering.passes import RADIANCE_CHANNELS
from dataset_builder.rendering.scene.triangle_soup import merge
from tests.rendering.transport.joined_bench import CLEAR, FRAME, LAMP, differ, lit, replicas, room, view_of
from tests.small_scenes import ball, box, camera, light, matte, sheet

FAILURES = 1 / 20_000
HIGH = {"position": (0.4, -0.3, 1.4)}
LAMPS = {
    "area": (LAMP,),
    "sphere": (light("sphere", (20.0, 18.0, 15.0), size=0.2, **HIGH),),
    "point": (light("point", (3.0, 2.5, 2.0), **HIGH),),
    "spot": (light("spot", (9.0, 8.0, 6.0), direction=(-0.4, 0.2, -1), cutoff=50, **HIGH),),
    "two lamps, dome and sun": (
        LAMP, light("point", (3.0, 2.5, 2.0), position=(-1.4, -0.3, 1.4), weight=0.6), light("dome", (0.4, 0.5, 0.6)),
        light("sun", (2.0, 2.0, 2.0), direction=(0.3, 0.5, -1), weight=0.8)),
}


def surface(**values):
    return Material(**{"name": "s", "base_color": (0.8, 0.6, 0.4), **values})


def bumps(roughness=1.0):
    """A wall that a normal map tilts by up to 60 degrees."""
    normal = np.random.default_rng(3).uniform(-0.8, 0.8, (8, 8, 3))
    normal[..., 2] = 1
    normal = (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32)
    return surface(roughness=roughness, texture=Texture(base_color=np.ones((8, 8, 3), np.float32), normal=normal))


def glass(**values):
    return surface(**{"base_color": (0.95, 0.9, 0.85), "roughness": 0.0, "transmission": 1.0, **values})


def placed(material, segments=24):
    return ball(material, centre=(-0.3, -0.2, -0.3), radius=0.6, segments=segments)


def second(material, segments=24):
    return ball(material, centre=(0.8, -0.6, -0.5), radius=0.4, segments=segments)


OPAQUE_ROOMS = {
    "glossy and metal": room(placed(surface(roughness=0.25)), second(surface(roughness=0.3, metallic=1.0)),
                             wall=surface(roughness=0.5)),
    "coat and sheen": room(placed(surface(sheen=(1, 0.8, 0.6), sheen_roughness=0.4)),
                           wall=surface(coat=0.8, coat_roughness=0.3, roughness=0.6)),
    "bumps": room(placed(matte()), wall=bumps()),
    "few faces, smooth-shaded": room(placed(matte((0.8, 0.8, 0.8)), 4), second(surface(roughness=0.4), 3)),
}
CLEAR_ROOMS = {
    "smooth and rough glass": room(placed(glass()), second(glass(roughness=0.4))),
    "coat and sheen over smooth glass": room(placed(glass(coat=1.0, coat_roughness=0.3)),
                                             second(glass(sheen=(1, 1, 1), sheen_roughness=0.4))),
    "panes and leaves": room(sheet(glass(thin=True), -0.6, 0.6), sheet(glass(thin=True, roughness=0.4), 0.3, 0.7, 3),
                             sheet(replace(matte((0.8, 0.7, 0.3)), alpha=0.4), 0.8, 1.0, 3)),
    "what shines": room(placed(surface(emission=(0.5, 0.2, 0.1), roughness=0.5))),
}


def without_ceiling(soup):
    """The same room, so that light from outside gets in."""
    keep = soup.corners[:, :, 2].min(axis=1) < 1.999
    return replace(soup, corners=soup.corners[keep], normals=soup.normals[keep], uvs=soup.uvs[keep],
                   material=soup.material[keep], instance=soup.instance[keep], part=soup.part[keep])


def assert_equal(opened, count=20, spp=25):
    """Both with and without light that is joined with the camera."""
    theirs = replicas(opened, "camera", count=count, spp=spp)
    for caustics in (False, True):
        ours = replicas(opened, "joined", count=count, spp=spp, seed=7, caustics=caustics)
        assert np.isfinite(ours).all() and ours[..., RADIANCE_CHANNELS["shading"]].min() >= 0
        assert differ(ours, theirs, FAILURES / 2) == []


@pytest.mark.parametrize("name", LAMPS)
def test_lamps(name):
    soup = room(placed(matte((0.8, 0.5, 0.2))))
    with lit(without_ceiling(soup) if "sun" in name else soup, *LAMPS[name]) as opened:
        assert_equal(opened)


def test_lamps_that_only_files_have(tmp_path):
    """Disk, cylinder, a ball too small for Mitsuba's, and an area light with a picture."""
    picture = np.zeros((4, 4, 3), np.uint8)
    picture[:2, :2], picture[2:, 2:] = (255, 60, 10), (20, 255, 100)
    Image.fromarray(picture).save(tmp_path / "lamp.png")
    shown = {"image": "lamp.png", "image_sha256": sha256_file(tmp_path / "lamp.png")}
    lamps = (light("area", (9.0, 8.0, 7.0), position=(1.2, 0.9, 1.7), size=0.7, length=0.4, turn=30, **shown),
             light("disk", (9.0, 8.0, 7.0), position=(-1.2, 0.9, 1.7), direction=(0.3, 0, -1), size=0.3),
             light("cylinder", (5.0, 5.0, 4.0), position=(0, -1.2, 1.5), direction=(1, 0, 0), size=0.1, length=0.8),
             light("sphere", (2000.0, 1800.0, 1500.0), size=0.01, **HIGH))
    with lit(room(placed(matte((0.8, 0.5, 0.2)))), *lamps, image_root=tmp_path) as opened:
        assert_equal(opened)


@pytest.mark.parametrize("name", OPAQUE_ROOMS)
def test_opaque_surfaces(name):
    with lit(OPAQUE_ROOMS[name]) as opened:
        assert_equal(opened)


@pytest.mark.parametrize("name", CLEAR_ROOMS)
def test_surfaces_that_let_light_through(name):
    with lit(CLEAR_ROOMS[name], features=CLEAR) as opened:
        assert_equal(opened)


def test_a_lamp_within_a_ball_of_glass_shines_as_if_it_were_bare():
    """From its middle all light leaves it at right angles, after so many reflections inside: only light paths find any.
    The floor gets I cos / d^2; the ball's faces leave a hundredth."""
    height, intensity = 1.0, np.array([3.0, 2.0, 1.0])
    lamp = light("point", tuple(intensity), position=(0, 0, height))
    soup = merge([box(matte((0.0, 0.0, 0.0)), (-4, -4, -0.1), (4, 4, 0), 2),
                  ball(glass(base_color=(1, 1, 1)), centre=(0, 0, height), radius=0.3, segments=64)])
    view = replace(view_of(), camera=camera((0, -2.4, 0.9), (0, -1.0, 0), fov=50))
    with lit(soup, lamp, features=CLEAR) as opened:
        theirs = replicas(opened, "camera", count=1, view=view)
        ours = replicas(opened, "joined", count=12, spp=100, caustics=True, view=view)
    x, y = floor_points(view)
    lower = len(FRAME) // 2 <= FRAME
    expected = (intensity * (height / (x**2 + y**2 + height**2)**1.5 / np.pi)[:, None])[lower].mean(axis=0)
    shading = RADIANCE_CHANNELS["shading"]
    assert theirs[:, lower, shading].max() < 1e-6
    found = ours[:, lower, shading].mean(axis=1)
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
    assert np.all(error < 0.03 * expected)
    assert np.all(np.abs(found.mean(axis=0) - expected) < 4 * error + 0.01 * expected)


def floor_points(view):
    """x and y where rays through the middle of pixels meet z = 0."""
    pinhole = Pinhole.of(view.camera, view.render.width, view.render.height)
    row, column = np.divmod(FRAME, view.render.width)
    way = pinhole.directions(column + 0.5, row + 0.5)
    return (pinhole.position + way * (-pinhole.position[2] / way[:, 2])[:, None])[:, :2].T
