from collections.abc import Callable
from functools import partial
from itertools import combinations

import numpy as np
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.scene.footprints import Box, Footprint, footprint, overlap
from dataset_builder.planning.scene.layout import Layout, Piece, Place, front_zone, lay_out
from dataset_builder.seeding import rng

RoomOf = Callable[..., RoomPlan]


def piece(name: str, size: tuple[float, float, float], place: Place, seed: int, shift: float = 0.0) -> Piece:
    low = (shift - size[0] / 2, -size[1] / 2, 0.0)
    high = (shift + size[0] / 2, size[1] / 2, size[2])
    return Piece(name=name, extent=Box(low=low, high=high), place=place, rng=partial(rng, seed, name))


def crowd(seed: int) -> list[Piece]:
    near = [piece(f"near{k}", (0.5, 0.4, 0.6), "near", seed, shift=0.1) for k in range(3)]
    wall = [piece(f"wall{k}", (1.1, 0.45, 1.9), "wall", seed) for k in range(4)]
    return [*wall, *near, *(piece(f"floor{k}", (0.8, 0.6, 0.5), "floor", seed) for k in range(3))]


def corners_of(thing: Piece, pose: tuple[tuple[float, float, float], float]) -> np.ndarray:
    """(4, 2) corners by complex rotation, apart from what planning does."""
    (x, y, _), yaw = pose
    low, high = thing.extent.low, thing.extent.high
    plane = np.array([complex(a, b) for a, b in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]),
                                                (low[0], high[1]))])
    turned = plane * np.exp(1j * np.radians(yaw)) + complex(x, y)
    return np.stack([turned.real, turned.imag], axis=1)


def apart(a: np.ndarray, b: np.ndarray) -> bool:
    """Separating-axis test on corners: some edge's normal has all of one polygon on one side of the other."""
    for polygon in (a, b):
        for k in range(4):
            edge = polygon[(k + 1) % 4] - polygon[k]
            normal = np.array([-edge[1], edge[0]])
            if (a @ normal).max() <= (b @ normal).min() or (b @ normal).max() <= (a @ normal).min():
                return True
    return False


def everything(target: Piece, pieces: list[Piece], layout: Layout) -> list[np.ndarray]:
    placed = [(thing, pose) for thing, pose in zip(pieces, layout.furniture, strict=True) if pose]
    return [corners_of(target, layout.target), *(corners_of(thing, pose) for thing, pose in placed)]


@pytest.mark.parametrize("seed", range(25))
def test_nothing_overlaps_and_nothing_leaves_the_room(seed: int, room_of: RoomOf) -> None:
    target, pieces, room = piece("target", (0.9, 0.7, 0.8), "floor", seed), crowd(seed), room_of(4.5, 4.0)
    layout = lay_out(target, pieces, BoxShell(room))
    boxes = everything(target, pieces, layout)
    assert all(apart(a, b) for a, b in combinations(boxes, 2))
    for box in boxes:
        assert np.abs(box[:, 0]).max() < room.width / 2 and np.abs(box[:, 1]).max() < room.depth / 2
    assert len(boxes) - 1 + len(layout.notes) == len(pieces)


def test_the_check_of_this_file_can_fail() -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    assert not apart(square, square + 0.5) and apart(square, square + 1.5)


@pytest.mark.parametrize("seed", range(10))
def test_walls_are_at_the_back_and_near_pieces_within_reach(seed: int, room_of: RoomOf) -> None:
    target, pieces, room = piece("target", (0.6, 0.6, 0.8), "floor", seed), crowd(seed), room_of(7.0, 6.0)
    layout = lay_out(target, pieces, BoxShell(room))
    stands = corners_of(target, layout.target)
    for thing, pose in zip(pieces, layout.furniture, strict=True):
        if pose is None:
            continue
        box = corners_of(thing, pose)
        if thing.place == "wall":
            back = box[2:].mean(axis=0)
            assert max(abs(back) - np.array([3.5, 3.0])) == pytest.approx(-0.05, abs=0.01)
            assert np.linalg.norm(back) > np.linalg.norm(box[:2].mean(axis=0)) - 1e-9
        elif thing.place == "near":
            gaps = np.linalg.norm(box[:, None] - stands[None], axis=-1)
            assert gaps.min() < 0.8 + 0.6


@pytest.mark.parametrize("seed", range(10))
def test_the_front_of_the_target_stays_free_where_there_is_room(seed: int, room_of: RoomOf) -> None:
    target, pieces = piece("target", (0.6, 0.6, 0.8), "floor", seed), crowd(seed)[:8]
    layout = lay_out(target, pieces, BoxShell(room_of(9.0, 9.0)))
    zone = front_zone(footprint(target.extent, *layout.target)).corners()
    boxes = everything(target, pieces, layout)[1:]
    assert all(apart(zone, box) for box in boxes)
    assert np.abs(zone).max() < 4.5


def test_a_target_that_does_not_fit_is_an_error_with_both_sizes(room_of: RoomOf) -> None:
    with pytest.raises(PlanError, match=r"5\.00 x 1\.00 x 1\.00 m in a room of 3\.00 x 3\.00 x 2\.50 m"):
        lay_out(piece("target", (5.0, 1.0, 1.0), "floor", 0), [], BoxShell(room_of(3.0, 3.0, 2.5)))
    with pytest.raises(PlanError, match="fit in the room"):
        lay_out(piece("target", (1.0, 1.0, 2.6), "wall", 0), [], BoxShell(room_of(3.0, 3.0, 2.5)))


def test_furniture_that_does_not_fit_is_left_out_with_a_note(room_of: RoomOf) -> None:
    huge, small = piece("huge", (3.5, 3.5, 1.0), "floor", 0), piece("small", (0.3, 0.3, 0.3), "floor", 0)
    layout = lay_out(piece("target", (0.8, 0.8, 0.8), "floor", 0), [huge, small], BoxShell(room_of(4.0, 4.0)))
    assert layout.furniture[0] is None and layout.furniture[1] is not None
    assert layout.notes == ("left out huge: no free place (floor) in 80 draws",)


def test_a_piece_more_moves_none_that_was_placed_before_it(room_of: RoomOf) -> None:
    target, pieces = piece("target", (0.9, 0.7, 0.8), "floor", 3), crowd(3)
    before = lay_out(target, pieces, BoxShell(room_of()))
    after = lay_out(target, [*pieces, piece("more", (0.4, 0.4, 0.4), "floor", 3)], BoxShell(room_of()))
    assert after.target == before.target and after.furniture[:-1] == before.furniture


def test_footprints_turn_about_the_base_point() -> None:
    extent = Box(low=(0.0, 0.0, 0.0), high=(2.0, 1.0, 1.0))
    box = footprint(extent, (10.0, 0.0, 0.0), 90.0)
    assert box.centre == pytest.approx((9.5, 1.0))
    assert sorted(map(tuple, box.corners().round(9).tolist())) == [(9.0, 0.0), (9.0, 2.0), (10.0, 0.0), (10.0, 2.0)]


def test_boxes_above_one_another_do_not_overlap() -> None:
    low = Footprint(centre=(0.0, 0.0), half=(1.0, 1.0), yaw=0.0, bottom=0.0, top=0.8)
    lamp = Footprint(centre=(0.0, 0.0), half=(0.2, 0.2), yaw=30.0, bottom=1.5, top=2.0)
    assert not overlap(low, lamp) and overlap(low, Footprint(centre=(0.0, 0.0), half=(0.2, 0.2), yaw=30.0))


def test_turned_boxes_whose_bounds_meet_may_still_be_apart() -> None:
    a = Footprint(centre=(0.0, 0.0), half=(1.0, 0.1), yaw=45.0)
    b = Footprint(centre=(0.6, -0.6), half=(1.0, 0.1), yaw=45.0)
    assert not overlap(a, b) and overlap(a, b, gap=0.7)


@pytest.mark.parametrize("seed", range(8))
def test_walls_and_furniture_keep_from_the_floor_about_a_target(seed: int, room_of: RoomOf) -> None:
    target, pieces = piece("target", (0.6, 0.6, 0.8), "floor", seed), crowd(seed)
    layout = lay_out(target, pieces, BoxShell(room_of(8.0, 8.0)), 1.5)
    about = footprint(target.extent, *layout.target).grown(1.5).corners()
    assert np.ptp(about @ np.stack([about[1] - about[0], about[3] - about[0]]).T, axis=0) == pytest.approx([3.6**2] * 2)
    boxes = everything(target, pieces, layout)[1:]
    assert boxes and all(apart(about, box) for box in boxes) and np.abs(about).max() < 4.0
    assert all(pose is None for thing, pose in zip(pieces, layout.furniture, strict=True) if thing.place == "near")
    with pytest.raises(PlanError, match=r"0\.60 x 0\.60 x 0\.80 m with 4 m of free floor about it in a room of 8\.00"
                                        r".*, or lower `space` of the scene"):
        lay_out(target, pieces, BoxShell(room_of(8.0, 8.0)), 4.0)
