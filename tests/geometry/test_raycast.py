"""Rays and distances against hand-computed answers."""

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.geometry import raycast
from dataset_builder.geometry.raycast import RayScene


@pytest.fixture
def two_boxes(shapes):
    """Unit cubes about (0, 0, 0) with id 7 and about (3, 0, 0) with id 4."""
    box = shapes["box"]()
    return RayScene([(box.positions, box.faces, 7), (box.positions + np.array((3, 0, 0)), box.faces, 4)])


def test_first_hit(two_boxes):
    origins = np.array([(-2.0, 0.1, 0.2), (5, 0.1, 0.2), (1.5, 0.1, 0.2), (1.5, 0, 9)])
    directions = np.array([(2.0, 0, 0), (-1, 0, 0), (0.1, 0, 0), (0, 0, 1)])
    ids, distance = two_boxes.first_hit(origins, directions)
    np.testing.assert_array_equal(ids, [7, 4, 4, 0])
    np.testing.assert_allclose(distance, [1.5, 1.5, 1, np.inf], rtol=1e-6)


def test_occluded_does_not_count_its_ends(two_boxes):
    origins = np.array([(-2.0, 0.1, 0.2), (0.5, 0.1, 0.2), (0.5, 0.1, 0.2), (1, 1, 1)])
    targets = np.array([(5.0, 0.1, 0.2), (2.5, 0.1, 0.2), (2.6, 0.1, 0.2), (1, 1, 1)])
    np.testing.assert_array_equal(two_boxes.occluded(origins, targets), [True, False, True, False])


def test_distance(two_boxes):
    points = np.array([(0, 0, 1.5), (0, 0, 0), (1.5, 0.1, 0), (0.5, 0, 0)])
    np.testing.assert_allclose(two_boxes.distance(points), [1, 0.5, 1, 0], atol=1e-6)


def test_an_empty_scene_meets_nothing():
    scene = RayScene([(np.zeros((0, 3)), np.zeros((0, 3), int), 1)])
    one = np.ones((1, 3))
    assert scene.first_hit(one, one)[0].tolist() == [0]
    assert not scene.occluded(one, -one).any()
    assert np.isinf(scene.distance(one)).all()


def test_ids_are_positive(shapes):
    box = shapes["box"]()
    with pytest.raises(ValueError, match="expected ids > 0, got 0"):
        RayScene([(box.positions, box.faces, 0)])


def test_answers_repeat_bit_for_bit_even_where_surfaces_coincide(shapes):
    torus = shapes["torus"](60, 40)
    generator = np.random.default_rng(0)
    origins, directions = generator.normal(size=(2, 5000, 3)) * (3, 3, 3)
    answers = []
    for _ in range(2):
        scene = RayScene([(torus.positions, torus.faces, 1), (torus.positions, torus.faces, 2)])
        answers.append(scene.first_hit(origins, directions))
    for one, other in zip(*answers, strict=True):
        np.testing.assert_array_equal(one, other)


def test_closest_points_and_their_normals(two_boxes):
    feet, normals = two_boxes.closest(np.array([(0.1, 0.2, 1.5), (2.2, 0.1, 0.2), (0.4, 0.1, 0.2)]))
    np.testing.assert_allclose(feet, [(0.1, 0.2, 0.5), (2.5, 0.1, 0.2), (0.5, 0.1, 0.2)], atol=1e-6)
    np.testing.assert_allclose(normals, [(0, 0, 1), (-1, 0, 0), (1, 0, 0)], atol=1e-6)


@pytest.mark.parametrize(("error", "message"), [
    (OSError("libusb-1.0.so.0: cannot open shared object file"), "apt-get install libusb-1.0-0"),
    (OSError("libGL.so.1: cannot open shared object file"), "apt-get install libgl1"),
    (ImportError("No module named 'open3d'"), "install the locked dependencies"),
])
def test_a_missing_library_says_what_to_type(monkeypatch, error, message):
    def fail(name):
        raise error
    monkeypatch.setattr(raycast.importlib, "import_module", fail)
    with pytest.raises(UserError, match=message):
        raycast.open3d()
