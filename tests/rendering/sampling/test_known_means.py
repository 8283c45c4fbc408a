"""Means of real scenes against converged ones: where light is even they are as good as they claim, and where chrome and
small lamps make them low they are said to be unknown."""

from functools import cache

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.rendering import plugins
from dataset_builder.rendering.passes import RADIANCE_CHANNELS, radiance_sampler
from dataset_builder.rendering.sampling.heavy_tails import layer_mean, least_known
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import merge
from dataset_builder.rendering.view_sensor import ViewSensor
from tests.small_scenes import ball, box, camera, corner_of_a_room, light, lit_by, matte, render_plan

SIZE, SPP, RUNS, CONVERGED = 32, 16, 10, 8
MIRROR = Material(name="chrome", base_color=(0.95, 0.95, 0.95), metallic=1.0, roughness=0.03)
LAYERS = ("image", "shading", "specular")
INSIDE = np.ones(SIZE * SIZE, dtype=bool)
DOME = light("dome", (0.3, 0.3, 0.4), weight=1)
EVEN = (light("area", (3, 3, 3), position=(1.0, -2.0, 3), direction=(-1, 2, -3), size=1.0), DOME)
SMALL = (light("sphere", (4e3, 4e3, 4e3), position=(0.8, -1.6, 2), size=0.02), DOME)
SCENES = {
    "even": (lambda: corner_of_a_room(ball(matte())), EVEN, False),
    "chrome": (lambda: merge([corner_of_a_room(ball(MIRROR)), box(MIRROR, (1.5, -2, -1), (1.6, 2, 3), 4)]),
               SMALL, True)}
"""Soup, lights, and whether light paths bring caustics; all of it by joined paths."""


@cache
def runs(name: str) -> tuple[dict[str, np.ndarray], dict[str, list]]:
    """By channels of the image: means of independent runs over their common mean, and what they say of it."""
    plugins.register()
    soup, lamps, caustics = SCENES[name]
    view = ViewSensor(camera=camera(), render=render_plan(SIZE))
    with open_scene(body_of(soup()), lit_by(*lamps)) as opened:
        sample = radiance_sampler(view, opened, 8, "joined", caustics)
        found = [sample(np.arange(SIZE * SIZE), SPP, 4, seed) for seed in range(RUNS)]
        long = sample(np.arange(SIZE * SIZE), SPP * RUNS * CONVERGED, 4, 999)
    means, said = {}, {}
    for layer in LAYERS:
        channels = RADIANCE_CHANNELS[layer]
        truth = long.mean[:, channels].mean()
        means[layer] = np.array([one.mean[:, channels].mean() for one in found]) / truth
        said[layer] = [layer_mean(one, channels, INSIDE, together=True, image=RADIANCE_CHANNELS["image"])
                       for one in found]
    return means, said


def test_even_light_is_known_and_errors_of_its_means_hold() -> None:
    """No alarm; z over runs and layers has a root mean square near 1, and next to none is beyond 3."""
    means, said = runs("even")
    parts = LAYERS[:2]
    assert not [layer for layer in parts for one in said[layer] if one.known == "unknown"]
    z = np.concatenate([(means[layer] - 1) / [one.error for one in said[layer]] for layer in parts])
    assert 0.4 < np.sqrt(np.mean(z**2)) < 1.4 and np.mean(np.abs(z) > 3) < 0.03


def test_means_of_chrome_and_small_lamps_are_unknown() -> None:
    """Most are low, by more than their pixels' errors claim: nearly all of the runs say that they do not know."""
    means, said = runs("chrome")
    image = said["image"]
    assert np.median(means["specular"]) < 0.8 and np.median(means["image"]) < 0.9
    for layer in ("image", "specular"):
        told = [least_known(one, whole) for one, whole in zip(said[layer], image, strict=True)]
        assert told.count("unknown") >= 0.9 * RUNS
