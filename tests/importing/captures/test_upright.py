"""Up, front and scale of captures, on cameras whose frame is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.assets.pose_readers.capture import Capture, CaptureShot, Lens
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.planes import largest_plane
from dataset_builder.importing.captures.photographs import Ball
from dataset_builder.importing.captures.settle import moved_poses, settled
from dataset_builder.importing.captures.upright import CapturePlacement, metres_per_unit, turned, up_of
from tests.assets.test_field_file import made as made_field
from tests.capture_files import MIDDLE, Made, orbit, tilted

BALL = Ball(centre=(0.0, 0.0, 0.0), radius=1.0)


def capture(poses: np.ndarray, **fields: object) -> Capture:
    lens = Lens(size=(8, 8), focal=(8.0, 8.0), centre=(4.0, 4.0))
    shots = tuple(CaptureShot(name=name, image=Path(name), mask=None, lens=lens, pose=pose)
                  for name, pose in zip((f"images/{index}.png" for index in range(len(poses))), poses, strict=True))
    return Capture(layout="COLMAP", shots=shots, **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize("arc", [360.0, 90.0])
def test_up_is_that_of_level_cameras_even_on_an_arc(arc: float) -> None:
    """The mean of the cameras' own up axes leans over on an arc: the right axes do not."""
    up, said = up_of(capture(Made(poses=orbit(24, arc=arc), turn=tilted()).told), "cameras", BALL)
    assert np.abs(up - tilted()[:, 2]).max() < 1e-9 and "level to 0.0 degrees" in said


def test_hands_shake() -> None:
    poses, draws = Made(turn=tilted()).told, np.random.default_rng(0)
    for pose in poses:
        roll = np.radians(draws.normal(0, 5))
        pose[:3, :3] = pose[:3, :3] @ [[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]]
    up, said = up_of(capture(poses), "cameras", BALL)
    # Two angles from 24 rolls of 5 degrees, of which one bears on each axis: 5 / sqrt(12) = 1.4 degrees on each
    assert np.degrees(np.arccos(up @ tilted()[:, 2])) < 5 and float(said.split()[-3]) == pytest.approx(5, rel=0.4)


def test_cameras_in_all_directions_say_nothing_of_up() -> None:
    poses = orbit(12)
    poses[::2, :3, :2] *= -1
    with pytest.raises(UserError, match=r"--up: expected cameras that agree .* \(give it as --up X,Y,Z"):
        up_of(capture(poses), "cameras", BALL)


def test_up_as_given() -> None:
    assert np.allclose(up_of(capture(orbit(8)), (0, 0, -3), BALL)[0], [0, 0, -1])
    with pytest.raises(UserError, match="expected a direction, got 0, 0, 0"):
        up_of(capture(orbit(8)), (0, 0, 0), BALL)


def test_up_from_the_plane_of_points() -> None:
    """200 points on the ground, 100 anywhere: the plane is found, and the side of the cameras."""
    draws = np.random.default_rng(0)
    ground = np.column_stack([draws.uniform(-2, 2, (200, 2)), draws.normal(0, 0.001, 200)])
    points = np.concatenate([ground, draws.uniform(-1, 1, (100, 3))])
    normal, share = largest_plane(points)
    assert abs(normal[2]) > 0.9999 and 0.66 < share < 0.75
    assert np.array_equal(largest_plane(points)[0], normal)
    found = capture(Made(turn=tilted()).told, points=dict(enumerate(map(tuple, (points @ tilted().T).tolist()))))
    up, said = up_of(found, "plane", BALL)
    assert np.degrees(np.arccos(up @ tilted()[:, 2])) < 0.5 and "% of the points lie on" in said
    with pytest.raises(UserError, match="at least 50 points to find a plane among, got 0"):
        up_of(capture(orbit(8)), "plane", BALL)


def test_the_first_camera_stands_before_the_front() -> None:
    up, first = tilted()[:, 2], tilted() @ [0, -2.0, 0.7]
    turn = turned(up, first, 0)
    assert np.allclose(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) == pytest.approx(1)
    assert np.allclose(turn @ up, [0, 0, 1]) and np.allclose(turn @ first, [0, -2, 0.7])
    # Counter-clockwise seen from above: what faced -Y faces +X
    assert np.allclose(turned(up, first, 90) @ first, [2, 0, 0.7])
    above = turned(up, up, 0)
    assert np.allclose(above @ up, [0, 0, 1]) and np.linalg.det(above) == pytest.approx(1)


def test_a_placement_keeps_what_cameras_see() -> None:
    made = Made(turn=tilted(), scale=3.0)
    place = CapturePlacement(turn=tilted().T, scale=1 / 3, origin=3 * tilted() @ MIDDLE)
    expected = made.poses.copy()
    expected[:, :3, 3] -= MIDDLE
    assert np.abs(place.poses(made.told) - expected).max() < 1e-12


def test_metres_from_cameras_and_points() -> None:
    found = capture(orbit(8), points={7: (1.0, 2.0, 3.0), 9: (1.0, 2.0, 7.0)})
    apart = np.linalg.norm(orbit(8)[0, :3, 3] - orbit(8)[3, :3, 3])
    assert metres_per_unit(found, ("0.png", "images/3.png", 0.5))[0] == pytest.approx(0.5 / apart)
    assert metres_per_unit(found, ("point:7", "point:9", 2.0))[0] == pytest.approx(0.5)
    assert metres_per_unit(found, None) == (0.0, "")
    assert metres_per_unit(replace(found, metric=True), None)[0] == 1
    for names, rule in ((("point:8", "0"), "got point:8, which is none"), (("0", "0"), "which are one"),
                        (("x", "0"), r"\(images/0.png, images/1.png, images/2.png, images/3.png and 4 more\)")):
        with pytest.raises(UserError, match=rule):
            metres_per_unit(found, (*names, 1.0))


def field() -> FieldFile:
    """A box of 2 x 4 x 6 about (5, 6, 7) on a grid, one lump 1 below it."""
    draws = np.random.default_rng(0)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)])
    inside = draws.uniform([-1, -2, -3], [1, 2, 3], (400, 3))
    positions = np.array([*corners, *inside, [0, 0, -4.0]]) + np.array([5.0, 6, 7])
    faces = np.array([*zip(*[iter(range(408))] * 3, strict=True), (0, 1, 408)])
    mesh = TriangleMesh(positions=positions, faces=faces, uvs=np.zeros((len(faces), 3, 2)),
                        material=np.zeros(len(faces)))
    return replace(made_field(), mesh=mesh, centre=(5.0, 6.0, 7.0), radius=5.0)


def test_a_field_settles_on_the_ground_at_its_height() -> None:
    """The lump, and what else is among the lowest hundredth, is pressed flat; centre and radius follow."""
    before = field()
    after = settled(before, 0.6)
    low, high = after.mesh.bounds
    assert low[2] == 0 and high[2] == pytest.approx(0.6) and np.allclose(low[:2] + high[:2], 0)
    scale = after.radius / before.radius
    ground = np.percentile(before.mesh.positions[:, 2], 1)
    assert scale == pytest.approx(0.6 / (10 - ground)) and 4 < ground < 4.2
    assert np.allclose(after.centre, scale * (np.array([5, 6, 7]) - [5, 6, ground]))
    assert (settled(before, None).radius, settled(before, None).mesh.bounds[1, 2]) == (5.0, pytest.approx(10 - ground))


def test_poses_follow_a_field_that_settles() -> None:
    before = field()
    after = settled(before, 0.6)
    poses = moved_poses(orbit(8), before, after)
    top = before.mesh.positions[:, 2].argmax()
    for pose, moved in zip(orbit(8), poses, strict=True):
        seen = pose[:3, :3].T @ (before.mesh.positions[top] - pose[:3, 3])
        again = moved[:3, :3].T @ (after.mesh.positions[top] - moved[:3, 3])
        assert np.allclose(again, seen * after.radius / before.radius)
