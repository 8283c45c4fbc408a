"""A procedural room answers by formulas; its draws are those that datasets were made with, so they are spelt out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.scene.footprints import Box, Footprint, Pose, footprint
from dataset_builder.seeding import rng
from tests.plans import example_plan

MIDDLE = np.zeros(3)
SIZES = st.floats(2.0, 12.0)
GAP = 0.05


def room(width: float, depth: float, height: float = 2.5) -> BoxShell:
    return BoxShell(example_plan().room.model_copy(update={"width": width, "depth": depth, "height": height}))


def low_and_high(extent: Box, yaw: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of a turned footprint whose base point is the origin."""
    corners = footprint(extent, (0.0, 0.0, 0.0), yaw).corners()
    return corners.min(axis=0), corners.max(axis=0)


def floor_pose(extent: Box, width: float, depth: float, draws: np.random.Generator) -> Pose:
    """A turn, then x and y evenly where the turned footprint is GAP from the walls."""
    yaw = draws.uniform(-180, 180)
    low, high = low_and_high(extent, yaw)
    free = np.maximum([width / 2 - GAP, depth / 2 - GAP] - (high - low) / 2, 0)
    x, y = draws.uniform(-1, 1, 2) * free - (low + high) / 2
    return (x, y, 0.0), yaw


def wall_pose(extent: Box, width: float, depth: float, draws: np.random.Generator) -> Pose:
    """A wall of +Y, -X, +X, -Y, then a place along it."""
    number = draws.integers(4)
    yaw, half = (0, 90, -90, 180)[number], (width / 2, depth / 2)
    low, high = low_and_high(extent, yaw)
    size, middle = (high - low) / 2, (low + high) / 2
    across = (1, 0, 0, 1)[number]
    sign, turn = (1, -1, 1, -1)[number], (-1, -1, 1, 1)[number]
    place = np.zeros(2)
    place[across] = sign * (half[across] - GAP - 1e-9 - size[across])
    place[1 - across] = turn * draws.uniform(-1, 1) * max(half[1 - across] - GAP - size[1 - across], 0)
    return (*(place - middle), 0.0), yaw  # type: ignore[return-value]


@given(width=SIZES, depth=SIZES, seed=st.integers(0, 1000), shift=st.floats(-0.5, 0.5))
def test_draws_are_those_that_datasets_were_made_with(width: float, depth: float, seed: int, shift: float) -> None:
    extent, shell = Box(low=(shift - 0.4, -0.3, 0.0), high=(shift + 0.5, 0.2, 0.9)), room(width, depth)
    for name, expected in (("on_floor", floor_pose), ("at_wall", wall_pose)):
        (position, yaw), wanted = getattr(shell, name)(extent, rng(seed)), expected(extent, width, depth, rng(seed))
        assert position == pytest.approx(wanted[0], abs=1e-12) and yaw == pytest.approx(wanted[1], abs=1e-12)
        assert shell.holds(footprint(extent, position, yaw))


@given(width=SIZES, depth=SIZES, margin=st.floats(0, 0.3), seed=st.integers(0, 1000))
def test_how_far_one_can_go_is_where_one_leaves(width: float, depth: float, margin: float, seed: int) -> None:
    shell, draws = room(width, depth), rng(seed)
    centre, direction = draws.uniform([-0.6, -0.6, 0.4], [0.6, 0.6, 2.1]), draws.normal(size=3)
    direction /= np.linalg.norm(direction)
    far = shell.depth(centre, direction, margin)
    for share in (0.0, 0.5, 1 - 1e-6):
        assert shell.inside(centre + share * far * direction, margin, MIDDLE)
    assert not shell.inside(centre + (1 + 1e-6) * far * direction, margin, MIDDLE)


def test_what_is_too_high_or_too_near_a_wall_is_not_held() -> None:
    shell = room(4.0, 3.0)
    assert shell.holds(Footprint(centre=(1.45, 0.0), half=(0.5, 0.5), yaw=0.0, top=2.5))
    assert not shell.holds(Footprint(centre=(1.46, 0.0), half=(0.5, 0.5), yaw=0.0, top=2.5))
    assert not shell.holds(Footprint(centre=(0.0, 0.0), half=(0.5, 0.5), yaw=0.0, top=2.51))
    assert not shell.holds(Footprint(centre=(0.0, 1.0), half=(0.4, 0.4), yaw=45.0, top=1.0))


def test_a_room_speaks_of_its_size() -> None:
    shell = room(4.0, 3.0, 2.0)
    assert shell.said == "a room of 4.00 x 3.00 x 2.00 m"
    assert shell.settled(Box(low=(0, 0, 0), high=(1, 1, 1)), ((1.0, 2.0, 0.7), 30.0)) == ((1.0, 2.0, 0.0), 30.0)
