"""Where things may stand in a scene given as triangles: nothing outside, in walls or in what is there already."""

from functools import partial
from itertools import product

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.errors import PlanError
from dataset_builder.planning.scene.footprints import Box, Footprint, Pose, footprint, overlap
from dataset_builder.planning.scene.layout import Piece, furnish, lay_out, place_target
from dataset_builder.planning.scene.mesh_shell import MeshShell
from dataset_builder.planning.scene.shell import Geometry
from dataset_builder.seeding import rng
from tests.planning.scene.houses import box, l_shape, shell, two_rooms, two_storeys, walled

STOOL = Box(low=(-0.25, -0.2, 0.0), high=(0.25, 0.2, 0.5))
BENCH = Box(low=(-0.9, -0.2, 0.0), high=(0.9, 0.2, 0.45))
SHELF = Box(low=(-0.4, -0.15, 0.0), high=(0.4, 0.15, 1.8))


def held(space: MeshShell, extent: Box, count: int, how: str = "on_floor", seed: int = 0) -> list[Pose]:
    """Poses among `count` draws that the shell holds."""
    draws = rng(seed, how)
    poses = [getattr(space, how)(extent, draws) for _ in range(count)]
    return [pose for pose in poses if pose is not None and space.holds(footprint(extent, *pose))]


def edges(extent: Box, pose: Pose) -> np.ndarray:
    """(N, 2) points along the sides of a footprint, 1 cm apart or less."""
    corners = footprint(extent, *pose).corners()
    share = np.linspace(0, 1, 200)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])


def in_l_shape(points: np.ndarray, gap: float) -> np.ndarray:
    x, y = points.T
    long = (x >= gap) & (x <= 6 - gap) & (y >= gap) & (y <= 3 - gap)
    return long | ((x >= gap) & (x <= 2 - gap) & (y >= gap) & (y <= 7 - gap))


@pytest.mark.parametrize("extent", [STOOL, BENCH])
def test_nothing_leaves_an_l_shape_or_crosses_its_inner_corner(extent: Box) -> None:
    space = shell(l_shape())
    poses = held(space, extent, 1000)
    assert len(poses) > 400
    for pose in poses:
        assert in_l_shape(edges(extent, pose), 0.04).all()
    places = np.array([pose[0][:2] for pose in poses])
    # 8 of 26 square metres are in the short arm, fewer where a bench is to fit
    assert 0.15 < (places[:, 1] > 3).mean() < 0.4


def test_a_footprint_across_the_corner_is_not_held() -> None:
    space = shell(l_shape())
    across = Footprint(centre=(1.9, 2.9), half=(0.3, 0.3), yaw=45.0, top=0.5)
    assert not space.holds(across)
    assert space.holds(Footprint(centre=(1.0, 2.9), half=(0.3, 0.3), yaw=45.0, top=0.5))


def test_free_floor_is_that_of_the_room_within_a_cell() -> None:
    """A room of 5 by 4 metres: 20 square metres, and 18 metres around, along which half a cell may count."""
    floor, = shell(walled(5, 4, 2.5)).space.floors
    assert floor.area == pytest.approx(20, abs=18 * 0.05) and floor.rooms == 1


def test_head_room_and_walls_bound_what_fits() -> None:
    space = shell(walled(5, 4, 2.5))
    for top, half, fits in ((2.49, 0.3, True), (2.52, 0.3, False), (1.0, 1.9, True), (1.0, 1.97, False)):
        assert space.holds(Footprint(centre=(2.5, 2.0), half=(0.3, half), yaw=0.0, top=top)) == fits
    assert not space.holds(Footprint(centre=(2.5, 9.0), half=(0.3, 0.3), yaw=0.0))
    assert not space.holds(Footprint(centre=(2.5, 2.0), half=(0.3, 0.3), yaw=0.0, bottom=0.5, top=1.0))


def test_things_stand_in_both_rooms_and_in_no_door_post() -> None:
    space = shell(two_rooms())
    floor, = space.space.floors
    assert floor.rooms == 2 and space.said == f"a scene with {floor.area:.1f} m² of free floor (1 storey, 2 rooms)"
    poses = held(space, BENCH, 600)
    x = np.array([pose[0][0] for pose in poses])
    assert min((x < 4).mean(), (x > 4).mean()) > 0.3
    wall = [Footprint(centre=(4.0, y), half=(0.05, h), yaw=0.0, top=2.5) for y, h in ((0.5, 0.5), (2.85, 1.15))]
    assert not any(overlap(footprint(BENCH, *pose), post, 0.03) for pose, post in product(poses, wall))


def test_every_storey_has_floor_and_the_roof_is_none() -> None:
    poses = held(shell(two_storeys()), STOOL, 300)
    z = np.array([pose[0][2] for pose in poses])
    assert set(z.round(3)) == {0.0, 2.7} and 0.35 < (z > 1).mean() < 0.65


def test_a_house_on_the_street_has_its_floor_indoors() -> None:
    """Neither the street nor the roof; the floor is 0.2 m above the street, in the same storey."""
    street = box((-20, -20, -0.3), (25, 24, -0.2))
    poses = held(shell([street, *walled(5, 4, 2.5)]), STOOL, 200)
    assert len(poses) > 50
    for (x, y, z), _ in poses:
        assert 0 < x < 5 and 0 < y < 4 and z == pytest.approx(0, abs=1e-4)


def test_an_outdoor_stage_has_its_ground_as_floor_between_the_trees() -> None:
    trees = [box((x, y, 0), (x + 0.3, y + 0.3, 4), 3 + k) for k, (x, y) in enumerate(product((-3, 0, 3), (-3, 0, 3)))]
    space = shell([box((-5, -5, -0.1), (5, 5, 0))], trees)
    poses = held(space, STOOL, 400)
    assert len(poses) > 250
    for pose in poses:
        assert np.abs(edges(STOOL, pose)).max() <= 5
        for tree in trees:
            (x0, y0, _), (x1, y1, _) = tree[0].min(axis=0), tree[0].max(axis=0)
            trunk = Footprint(centre=((x0 + x1) / 2, (y0 + y1) / 2), half=((x1 - x0) / 2, (y1 - y0) / 2), yaw=0, top=4)
            assert not overlap(footprint(STOOL, *pose), trunk, 0.02)
    assert space.at_wall(SHELF, rng(0)) is None


def test_tables_and_beds_are_no_floor_and_carpets_are() -> None:
    table = [box((1, 1, 0.7), (3, 2.5, 0.75), 3), *(box((x, y, 0), (x + 0.04, y + 0.04, 0.7), 3)
                                                    for x, y in product((1, 2.96), (1, 2.46)))]
    bed, carpet = box((4, 1, 0.3), (6, 3, 0.5), 4), box((1, 3, 0), (6, 4.8, 0.015), 5)
    space = shell(walled(7, 5, 2.5), [*table, bed, carpet])
    poses = held(space, STOOL, 500)
    on_carpet = 0
    for (x, y, z), _ in poses:
        assert not (1 <= x <= 3 and 1 <= y <= 2.5) and not (4 <= x <= 6 and 1 <= y <= 3)
        assert z == pytest.approx(0.015, abs=1e-4) or z == pytest.approx(0, abs=1e-4)
        on_carpet += z > 0.01
    assert on_carpet > 50
    chair = space.settled(STOOL, ((0.5, 0.5, 0.4), 10.0))
    assert chair == ((0.5, 0.5, pytest.approx(0, abs=1e-4)), 10.0)


def test_a_gentle_slope_holds_what_a_steep_one_does_not() -> None:
    def hill(rise: float) -> Geometry:
        positions = np.array([[0, 0, 0], [10, 0, 10 * rise], [10, 8, 10 * rise], [0, 8, 0]], float)
        return positions, np.array([[0, 1, 2], [0, 2, 3]]), 2

    gentle = held(shell([hill(0.05)]), STOOL, 100)
    assert len(gentle) > 60
    for (x, _, z), _ in gentle:
        assert z == pytest.approx(0.05 * x, abs=0.05)
    assert not held(shell([hill(0.4)]), STOOL, 100)


@pytest.mark.parametrize("house", [[], [box((0, 0, 0), (0.1, 5, 2.5)), box((0, 0, 0), (5, 0.1, 2.5))],
                                   [box((0, 0, 0), (0.5, 0.5, 0.1))]])
def test_a_stage_without_a_floor_is_refused_only_where_something_is_to_stand(house: list[Geometry]) -> None:
    space = shell(house)
    for draw in (space.on_floor, space.at_wall):
        with pytest.raises(PlanError, match="a stage without a floor") as caught:
            draw(STOOL, rng(0))
        assert "`parts`" in str(caught.value) and str(caught.value).startswith("house")
    assert furnish(footprint(STOOL, (0, 0, 0), 0), (), space) == ((), ())


@pytest.mark.parametrize("house", [l_shape, two_rooms, two_storeys])
def test_backs_are_to_walls(house: type) -> None:
    """The way from the back to the nearest wall behind it, from the middle and both ends, low and high."""
    space = shell(house())
    poses = held(space, SHELF, 80, "at_wall")
    assert len(poses) > 40
    for pose in poses:
        own = footprint(SHELF, *pose)
        back = own.corners()[2:]
        for height, share in product((0.1, 0.9, 1.7), (0.0, 0.5, 1.0)):
            start = np.array([*(back[0] + share * (back[1] - back[0])), pose[0][2] + height])
            way = np.array([*own.axes[1], 0.0])
            assert space.space.house.first_hit(start[None], way[None])[1][0] == pytest.approx(0.05, abs=0.01)
    yaws = {round(pose[1]) % 360 for pose in poses}
    assert yaws == {0, 90, 180, 270}


def test_nothing_high_stands_before_a_window_or_an_open_door() -> None:
    """The wall at y = 4 has a window from x = 1 to 4."""
    low = [part for part in walled(5, 4, 2.5) if part[0].min(axis=0)[1] < 3.9]
    high = [box((0, 4, 0), (5, 4.1, 0.9)), box((0, 4, 0.9), (1, 4.1, 2.5)), box((4, 4, 0.9), (5, 4.1, 2.5)),
            box((1, 4, 2.2), (4, 4.1, 2.5))]
    space = shell([*low, *high])
    for (x, y, _), yaw in held(space, SHELF, 300, "at_wall"):
        assert y < 3.5 or abs(yaw) > 1 or not 0.6 < x < 4.4
    benches = [pose for pose in held(space, BENCH, 300, "at_wall") if pose[0][1] > 3.7 and 1.5 < pose[0][0] < 3.5]
    assert benches


@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 100_000))
def test_what_is_held_meets_nothing_that_is_there(seed: int) -> None:
    """Boxes at random, some on legs as thin as 1 cm; the oracle is the separating-axis test."""
    draws = rng(seed)
    things, taken = list[Geometry](), list[Footprint]()
    for k in range(8):
        low, size = draws.uniform([0, 0], [5, 4]), draws.uniform([0.01, 0.01, 0.06], [0.8, 0.8, 1.5])
        bottom = float(draws.choice([0.0, 0.3]))
        things.append(box((*low, bottom), (*(low + size[:2]), bottom + size[2]), 3 + k))
        middle, half = low + size[:2] / 2, size[:2] / 2
        taken.append(Footprint(centre=(middle[0], middle[1]), half=(half[0], half[1]), yaw=0.0, bottom=bottom,
                               top=bottom + size[2]))
    space = shell(walled(5, 4, 2.5), things)
    extent = STOOL if draws.uniform() < 0.5 else BENCH
    for pose in held(space, extent, 40, seed=seed):
        own = footprint(extent, *pose)
        assert not any(overlap(own, thing, 0.02) for thing in taken)
        points = edges(extent, pose)
        assert (points >= 0.04).all() and (points <= [4.96, 3.96]).all()


def test_layout_places_a_target_and_furniture_on_its_storey() -> None:
    def piece(name: str, extent: Box, place: str) -> Piece:
        return Piece(name=name, extent=extent, place=place, rng=partial(rng, 4, name))  # type: ignore[arg-type]

    space = shell(two_storeys())
    pieces = [piece("near", STOOL, "near"), piece("shelf", SHELF, "wall"), piece("bench", BENCH, "floor")]
    layout = lay_out(piece("target", STOOL, "floor"), pieces, space)
    assert layout.notes == () and layout.furniture[0] is not None
    assert layout.furniture[0][0][2] == pytest.approx(layout.target[0][2], abs=1e-4)
    with pytest.raises(PlanError, match=r"target in house: expected the target to fit in the scene, got an object of "
                                        r"9\.00 x 1\.00 x 1\.00 m in a scene with \d+\.\d m² of free floor"):
        place_target(piece("target", Box(low=(-4.5, -0.5, 0), high=(4.5, 0.5, 1)), "floor"), space)


def test_equal_triangles_share_their_space_and_others_do_not() -> None:
    first, again = shell(l_shape()), shell(l_shape())
    assert again.space is first.space
    assert shell(l_shape(2.7)).space is not first.space and shell([], l_shape()).space is not first.space


def test_a_scene_of_which_nothing_says_what_is_built_has_its_largest_level_as_floor() -> None:
    """Beds and tables are no floor then, either."""
    bed = box((4, 1, 0.3), (6, 3, 0.5), 4)
    for (x, y, z), _ in held(shell([], [*walled(7, 5, 2.5), bed]), STOOL, 200):
        assert z == pytest.approx(0, abs=1e-4) and not (4 <= x <= 6 and 1 <= y <= 3)


def test_a_closed_mesh_is_a_room_or_a_block_as_its_faces_wind() -> None:
    """One box for walls, floor and ceiling: with its faces inward one stands in it, else upon it."""
    positions, faces, _ = box((0, 0, 0), (5, 4, 2.5))
    for winding, z in ((faces[:, ::-1], 0.0), (faces, 2.5)):
        poses = held(shell([(positions, winding, 2)]), STOOL, 60)
        assert len(poses) > 30 and {round(pose[0][2], 3) for pose in poses} == {z}


def test_a_floor_that_faces_down_is_one_where_none_faces_up() -> None:
    positions, faces, _ = box((0, 0, 0), (5, 4, 2.5))
    floor = faces[(positions[faces][:, :, 2] == 0).all(axis=1)]
    assert len(floor) == 2 and len(held(shell([(positions, floor, 2)]), STOOL, 60)) > 30
