"""Bodies of glass in each other as pictures: a white furnace, what cannot be seen, and the same modelled otherwise."""

from dataclasses import replace

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.rendering import passes
from dataset_builder.rendering.passes import ViewSensor
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import merge
from tests.small_scenes import ball, box, camera, light, lit_by, matte, render_plan

NESTED = frozenset({"specular", "glass", "nested"})
SIZE = 24
WALL = [box(matte((0.7, 0.2, 0.2)), (-3, 2, -3), (0, 2.2, 3)), box(matte((0.2, 0.7, 0.2)), (0, 2, -3), (3, 2.2, 3))]


def glass(ior, priority, **more):
    return Material(name=f"glass {ior:.3f} {priority}", base_color=(1, 1, 1), roughness=0.0, transmission=1.0, ior=ior,
                    priority=priority, **more)


def picture(*parts, seed=1, spp=128, depth=64, features=NESTED):
    """(3,) mean of the frame, its standard error, and (SIZE^2, 3) pixels."""
    with open_scene(body_of(merge(parts), features=features), lit_by(light("dome", (1, 1, 1)))) as opened:
        found = passes.radiance(ViewSensor(camera=camera(), render=render_plan(SIZE)), opened,
                                np.arange(SIZE * SIZE), max_depth=depth, spp=spp, seed=seed,
                                wanted=frozenset({"image"}))
    error = np.sqrt((found.error[:, :3] ** 2).sum(axis=0)) / SIZE**2
    return found.mean[:, :3].mean(axis=0), error, found.mean[:, :3]


def agree(one, other):
    """Whether two means are equal within five standard errors of their difference."""
    return bool(np.all(np.abs(one[0] - other[0]) < 5 * np.hypot(one[1], other[1])))


def inverted(soup):
    """The same surface with its outside in."""
    return replace(soup, corners=soup.corners[:, ::-1], normals=-soup.normals[:, ::-1], uvs=soup.uvs[:, ::-1])


def cube(material, half):
    return box(material, (-half,) * 3, (half,) * 3)


def test_bodies_that_overlap_keep_the_light_of_a_white_furnace():
    mean, error, _ = picture(ball(glass(1.5, 2), radius=1.2), ball(glass(1.33, 1), (0.5, 0, 0), 1.0))
    assert np.all(np.abs(mean - 1) < 5 * error + 1e-3)


def test_a_ball_of_the_same_index_as_the_liquid_about_it_vanishes():
    water = box(glass(1.33, 1), (-2, -1.5, -2), (2, 1.5, 2))
    alone = picture(water, *WALL)
    assert agree(alone, picture(water, ball(glass(1.33, 2), radius=0.8), *WALL, seed=2))
    # With air around it, as without a priority, it does not
    assert not agree(alone, picture(water, ball(glass(1.33, 0), radius=0.8), *WALL, seed=2))


def test_liquid_that_overlaps_its_bottle_is_liquid_that_touches_it():
    """The bottle owns the overlap. The same thing without nesting: a cavity whose wall has the index of both."""
    def filled(bottle, liquid, wall, **more):
        outer, inner = cube(glass(*bottle), 1.0), inverted(cube(glass(*wall), 0.8))
        return picture(outer, inner, *(cube(glass(*each), 0.9) for each in liquid), *WALL, spp=256, depth=128, **more)

    modelled = filled((1.5, 0), [], (1.5 / 1.33, 0), seed=2, features=NESTED - {"nested"})
    owned, unowned = (filled((1.5, up), [(1.33, low)], (1.5, up)) for up, low in ((2, 1), (0, 0)))
    assert agree(owned, modelled) and not agree(unowned, modelled)
    off, far_off = (np.sqrt(np.square(found[2] - modelled[2]).mean()) for found in (owned, unowned))
    assert off < 0.5 * far_off


def test_a_kernel_that_counts_bodies_gives_single_ones_as_one_that_does_not():
    lone = ball(glass(1.5, 0, abbe=30.0), radius=1.0)
    with_it, without = (picture(lone, *WALL, features=frozenset({"specular", "glass", "dispersion"}) | more)
                        for more in (frozenset(), frozenset({"nested"})))
    assert np.allclose(with_it[2], without[2], rtol=1e-3, atol=1e-3) or agree(with_it, without)
