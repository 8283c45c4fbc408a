"""Joined paths with aimed light paths have the means of camera paths, where those find caustics well."""

import numpy as np
import pytest
from scipy import stats

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.passes import radiance_sampler
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.view_sensor import ViewSensor
from tests.small_scenes import ball, camera, corner_of_a_room, light, lit_by, matte, render_plan

SIZE, BLOCK, SPP, RUNS, DEPTH = 16, 8, 64, 16, 6
FAILURES, ROUNDING = 0.001, 1e-6
STEEL = Material(name="steel", base_color=(0.9, 0.8, 0.6), metallic=1.0, roughness=0.3)
LIGHTS = {
    "large lamp": [light("area", (4.0, 4.0, 4.0), position=(1.0, -1.0, 2.5), size=1.5)],
    "lamp within the sphere": [light("sphere", (30.0, 20.0, 10.0), position=(0.7, -0.3, 0.75), size=0.2)],
    "beam": [light("spot", (30.0, 30.0, 30.0), position=(0.5, -1.5, 2.0), direction=(-0.25, 0.7, -1), cutoff=30)],
    "several": [light("area", (4.0, 4.0, 4.0), position=(1.0, -1.0, 2.5), size=1.5, weight=2),
                light("point", (3.0, 3.0, 3.0), position=(-1.0, -1.0, 1.5)),
                light("dome", (0.2, 0.2, 0.3), weight=2)],
}


@pytest.mark.parametrize(("material", "lights"), [
    *((STEEL, lights) for lights in LIGHTS), (matte(), "several")], ids=[*LIGHTS, "nothing to aim at"])
def test_aimed_paths_are_unbiased(material: Material, lights: str) -> None:
    """Means over blocks of pixels of image, shading and specular part, over independent runs (Welch, Sidak)."""
    view, pixels = ViewSensor(camera=camera(), render=render_plan(SIZE)), np.arange(SIZE * SIZE)
    soup = corner_of_a_room(ball(material))
    runs = {}
    with open_scene(body_of(soup), lit_by(*LIGHTS[lights])) as opened:
        assert len(opened.body.casters) == (material is STEEL)
        for transport, caustics in (("camera", False), ("joined", True)):
            sample = radiance_sampler(view, opened, DEPTH, transport, caustics)
            runs[transport] = np.array([blocks(sample(pixels, SPP, 1, seed).mean[:, :9]) for seed in range(RUNS)])
    some = runs["camera"].mean(axis=0) > ROUNDING
    p = stats.ttest_ind(runs["camera"][:, some], runs["joined"][:, some], axis=0, equal_var=False).pvalue
    assert p.size >= 12 and p.min() > 1 - (1 - FAILURES) ** (1 / p.size)


def blocks(means: np.ndarray) -> np.ndarray:
    cut = means.reshape(SIZE // BLOCK, BLOCK, SIZE // BLOCK, BLOCK, -1)
    return cut.mean(axis=(1, 3)).ravel()
