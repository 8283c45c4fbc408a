"""The spheres that light paths are aimed at hold what throws caustics, and nothing else."""

import numpy as np
import pytest

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.scene.open_scene import MOST_CASTERS, casters_of
from dataset_builder.rendering.scene.triangle_soup import merge
from tests.small_scenes import ball, box, matte

CHROME = Material(name="chrome", base_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.05)
SATIN = Material(name="satin", base_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.5)


def test_each_instance_that_gathers_light_has_a_sphere() -> None:
    floor = box(matte(), (-3, -3, -1.2), (3, 3, -1))
    first, second = ball(CHROME, (1, 0, 0), 0.5, 1), box(CHROME, (-1, -1, -1), (0, 1, 1), 3)
    found = casters_of(merge([floor, first, ball(SATIN, (0, 2, 0), 0.5, 4), second]))
    assert found == pytest.approx(np.array([[-0.5, 0, 0, 1.5], [1, 0, 0, 0.5]]), abs=1e-9)


def test_faces_that_are_matte_or_taken_away_count_for_nothing() -> None:
    part = merge([box(matte(), (4, -1, -1), (9, 1, 1), 1), ball(CHROME, (1, 0, 0), 0.5, 1)])
    assert casters_of(part)[:, 3] == pytest.approx([0.5])
    assert casters_of(part.only(np.zeros(len(part.corners), dtype=bool))).shape == (0, 4)
    assert casters_of(box(matte(), (0, 0, 0), (1, 1, 1))).shape == casters_of(merge([])).shape == (0, 4)


def test_of_many_the_largest_are_kept() -> None:
    many = [ball(CHROME, (4 * k, 0, 0), 0.1 + 0.01 * k, k + 1, segments=4) for k in range(MOST_CASTERS + 3)]
    radii = casters_of(merge(many))[:, 3]
    assert radii == pytest.approx([0.1 + 0.01 * k for k in range(MOST_CASTERS + 2, 2, -1)])
