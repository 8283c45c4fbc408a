"""The camera by its laws: there and back, right-handed axes, values known by hand, both conventions on one point."""

import numpy as np
import pytest

from dataset_builder.geometry.pinhole import Pinhole, look_at, sphere_lattice
from dataset_builder.seeding import rng
from tests.plans import example_plan

SOUTH = Pinhole(position=np.array([0.0, -2.0, 1.0]), target=np.array([0.0, 0.0, 1.0]), fov=90.0, width=24, height=16)
"""Looks to the north, level: right is east, up is up."""


def cameras(count: int = 20) -> list[Pinhole]:
    """Cameras anywhere, aimed anywhere, some of them rolled."""
    stream = rng(0, "pinhole")
    return [Pinhole(position=3 * stream.normal(size=3), target=stream.normal(size=3), width=number + 4,
                    up=np.array([0.0, 0.0, 1.0]) if number % 2 else stream.normal(size=3),
                    fov=float(stream.uniform(10, 130)), height=int(stream.integers(4, 40))) for number in range(count)]


def test_known_axes_and_matrices() -> None:
    assert np.array_equal(SOUTH.basis, [[1, 0, 0], [0, 0, 1], [0, 1, 0]])
    assert np.allclose(SOUTH.intrinsics, [[12, 0, 12], [0, 12, 8], [0, 0, 1]])
    assert np.allclose(SOUTH.opencv_extrinsics, [[1, 0, 0, 0], [0, 0, -1, 1], [0, 1, 0, 2], [0, 0, 0, 1]])
    assert np.allclose(SOUTH.opengl_pose, [[1, 0, 0, 0], [0, 0, -1, -2], [0, 1, 0, 1], [0, 0, 0, 1]])


def test_known_pixels() -> None:
    """fov 90 over 24 columns: the edge of the frame lies as far to the side as away; rows count downwards."""
    assert np.allclose(SOUTH.project(np.array([[0.0, 0, 1], [2, 0, 1], [0, 0, 2]])),
                       [[12, 8, 2], [24, 8, 2], [12, 2, 2]])
    found = SOUTH.unproject(np.full((16, 24), 3.0)) - SOUTH.position
    assert found[7:9, 11:13].mean(axis=(0, 1)) == pytest.approx([0, 3, 0])
    assert found[0, 23] == pytest.approx([3 * 23 / 24, 3, 3 * 15 / 16 * 16 / 24])


@pytest.mark.parametrize("camera", cameras())
def test_axes_are_unit_square_and_right_handed(camera: Pinhole) -> None:
    right, up, forward = camera.basis
    assert np.allclose(camera.basis @ camera.basis.T, np.eye(3))
    assert np.allclose(np.cross(right, up), -forward) and up @ camera.up > 0
    for matrix in (camera.opencv_extrinsics, camera.opengl_pose):
        assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1) and matrix[3].tolist() == [0, 0, 0, 1]


@pytest.mark.parametrize("camera", cameras())
def test_there_and_back(camera: Pinhole) -> None:
    depth = rng(1).uniform(0.1, 9, (camera.height, camera.width))
    back = camera.project(camera.unproject(depth).reshape(-1, 3)).reshape(camera.height, camera.width, 3)
    rows, columns = np.mgrid[:camera.height, :camera.width] + 0.5
    assert np.allclose(back, np.stack([columns, rows, depth], axis=-1))


@pytest.mark.parametrize("camera", cameras())
def test_the_matrices_say_what_project_says(camera: Pinhole) -> None:
    points = camera.unproject(rng(2).uniform(0.1, 9, (camera.height, camera.width))).reshape(-1, 3)
    homogeneous = np.column_stack([points, np.ones(len(points))])
    seen = (camera.opencv_extrinsics @ homogeneous.T)[:3]
    column, row, distance = camera.project(points).T
    assert np.allclose(camera.intrinsics @ seen, np.stack([column, row, np.ones(len(points))]) * distance)
    turned = np.linalg.inv(camera.opengl_pose) @ homogeneous.T
    assert np.allclose(turned[:3], seen * [[1], [-1], [-1]])


@pytest.mark.parametrize("camera", cameras())
def test_poses_are_extrinsics_the_other_way(camera: Pinhole) -> None:
    assert np.allclose(camera.opencv_pose @ camera.opencv_extrinsics, np.eye(4), atol=1e-12)
    assert np.allclose(camera.opencv_pose @ np.diag([1.0, -1, -1, 1]), camera.opengl_pose, atol=1e-12)


def test_a_lattice_covers_the_sphere_evenly() -> None:
    ways = sphere_lattice(200)
    assert np.allclose(np.linalg.norm(ways, axis=1), 1) and np.abs(ways.mean(axis=0)).max() < 0.01
    assert np.allclose(ways.T @ ways / 200, np.eye(3) / 3, atol=0.005)


def test_points_behind_have_a_negative_distance() -> None:
    assert SOUTH.project(np.array([[0.0, -3, 1]]))[0, 2] == pytest.approx(-1)


def test_the_camera_of_a_label() -> None:
    plan = example_plan().camera
    camera = Pinhole.of(plan, 48, 32)
    assert np.array_equal(camera.basis, look_at(plan.position, plan.target, plan.up)) and camera.fov == plan.fov
    assert camera.project(np.array([plan.target]))[0, :2] == pytest.approx([24, 16])


def test_a_depth_of_another_frame_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected a depth of shape \(16, 24\), got \(24, 16\)"):
        SOUTH.unproject(np.ones((24, 16)))
