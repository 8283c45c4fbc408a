"""Where things of a 3D-FRONT scene stand, which way they face, and how they are called."""

import numpy as np
import pytest

from dataset_builder.assets.scene_file import load_scene
from dataset_builder.geometry.mesh import transform
from dataset_builder.label.scene_source import PartPatterns
from tests.front3d_faults import FAULTS
from tests.front3d_files import FLOORS, HEIGHT, house

BEDROOM = {"rooms": ("Bedroom-31",), "models": ("lshape",)}
PLACE = np.array([5.6, 0.0, 3.2])
"""Of the L-shaped piece, in the axes of the file."""
BLOCK, TOWER = ((-0.3, 0, -0.2), (0.3, 0.2, 0.2)), ((0.1, 0.2, -0.2), (0.3, 0.5, 0.2))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("house")
    return load_scene(house().write(folder), folder, max_texture=64)


def placed(folder, made=None, **child):
    """World mesh of the L-shaped piece with other values of its child."""
    made = made or house(**BEDROOM)
    made.child("lshape").update(child)
    model = load_scene(made.write(folder), folder, max_texture=64)
    thing = next(thing for thing in model.things if thing.category == "corner/side table")
    return transform(thing.asset.mesh, thing.world)


def corners(box):
    """(8, 3) of a box."""
    low, high = np.array(box)
    return np.array([np.where([n & 1, n & 2, n & 4], high, low) for n in range(8)])


def expected(linear, place=PLACE):
    """World corners of the piece under a (3, 3) map in the file's axes, then at a place, Y up to Z up: (x, -z, y)."""
    points = np.concatenate([corners(BLOCK), corners(TOWER)]) @ np.array(linear, float).T + place
    return points[:, [0, 2, 1]] * [1, -1, 1]


def same_points(found, wanted, atol=1e-5):
    """Whether two sets of points are one, up to points that are there twice."""
    distance = np.linalg.norm(found[:, None] - wanted[None], axis=2)
    return distance.min(axis=1).max() < atol and distance.min(axis=0).max() < atol


@pytest.mark.parametrize(("child", "linear"), [
    ({}, np.eye(3)),
    ({"scale": [-1, 1, 1]}, np.diag([-1, 1, 1])),
    ({"scale": [0.829, 2.0953, 1.1]}, np.diag([0.829, 2.0953, 1.1])),
    # A quarter turn about +Y: +Z to +X, +X to -Z
    ({"rot": [0, 0.70711, 0, 0.70711]}, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    # About +X: +Y to +Z, +Z to -Y; ATISS's axis-angle would take it for something else
    ({"rot": [0.70711, 0, 0, 0.70711]}, [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    # About +Z: +X to +Y
    ({"rot": [0, 0, 0.70711, 0.70711]}, [[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    # A third of a turn about (1, 1, 1): X to Y to Z to X
    ({"rot": [0.5, 0.5, 0.5, 0.5]}, [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    # Scaled first, then turned
    ({"rot": [0, 0.70711, 0, 0.70711], "scale": [2, 1, 1]}, [[0, 0, 1], [0, 1, 0], [-2, 0, 0]]),
    ({"rot": [0, 0.70711, 0, 0.70711], "scale": [1, 1, -1]}, [[0, 0, -1], [0, 1, 0], [-1, 0, 0]]),
])
def test_pieces_are_scaled_turned_and_moved(tmp_path, child, linear):
    mesh = placed(tmp_path, **child)
    assert same_points(mesh.positions, expected(linear))
    # Outward after mirrors, too
    assert mesh.volume == pytest.approx((0.6 * 0.2 * 0.4 + 0.2 * 0.3 * 0.4) * abs(np.linalg.det(linear)), rel=1e-4)


def test_rooms_and_the_scene_move_what_they_hold(tmp_path):
    made = house(**BEDROOM)
    made.room("Bedroom-31")["pos"] = [0, 3, 0]
    made.document["scene"].update(rot=[0, 1, 0, 0], pos=[1, 0, 0])  # Half a turn about +Y, then 1 m along +X
    linear = np.diag([-1, 1, -1])
    place = linear @ (PLACE + np.array([0, 3, 0])) + [1, 0, 0]
    assert same_points(placed(tmp_path, made).positions, expected(linear, place))


def test_models_in_centimetres_have_the_right_size(tmp_path):
    made = house(**BEDROOM)
    FAULTS["centimetres by size"][0](made)
    assert same_points(placed(tmp_path, made).positions, expected(np.eye(3)))


def test_the_spec_scales_all(tmp_path):
    made = house(**BEDROOM)
    model = load_scene(made.write(tmp_path).model_copy(update={"scale": 2.0}), tmp_path)
    floor = next(thing for thing in model.things if thing.role == "floor")
    assert transform(floor.asset.mesh, floor.world).size == pytest.approx((7.76, 7.76, 0), abs=1e-9)


def inside(points):
    """Whether (N, 2) points x, y of the world lie on a floor."""
    found = np.zeros(len(points), bool)
    for (x0, z0), (x1, z1) in (box for boxes in FLOORS.values() for box in boxes):
        found |= (points[:, 0] > x0) & (points[:, 0] < x1) & (-points[:, 1] > z0) & (-points[:, 1] < z1)
    return found


def test_floors_face_up_ceilings_down_and_walls_into_rooms(whole):
    seen = set()
    for thing in whole.things:
        mesh = transform(thing.asset.mesh, thing.world)
        normals = mesh.area_normals / np.linalg.norm(mesh.area_normals, axis=1, keepdims=True)
        if thing.category in ("floor", "walltop"):
            assert normals == pytest.approx(np.tile([0, 0, 1], (len(normals), 1)), abs=1e-6)
        if thing.category == "ceiling":
            assert normals == pytest.approx(np.tile([0, 0, -1], (len(normals), 1)), abs=1e-6)
            assert mesh.bounds[:, 2] == pytest.approx([HEIGHT, HEIGHT])
        if thing.category in ("wallinner", "wallouter"):
            ahead = mesh.corners.mean(axis=1) + 0.02 * normals
            assert inside(ahead[:, :2]).all() == (thing.category == "wallinner")
        seen.add((thing.category, thing.role))
    assert {("floor", "floor"), ("ceiling", "ceiling"), ("wallinner", "walls"), ("wallouter", "walls"),
            ("walltop", "walls"), ("door", "walls"), ("window", "walls"), ("baseboard", "walls"),
            ("cornice", "ceiling"), ("floor lamp", "object"), ("dining chair", "object")} <= seen


def test_categories_are_those_of_the_list_of_models(whole):
    """In lower case; where the list has none, the one above it. The house's own are not asked."""
    found = {thing.category for thing in whole.things if thing.role == "object"}
    assert {"three-seat/multi-seat sofa", "cabinet/shelf/desk", "corner/side table"} <= found


def test_pieces_of_a_model_share_an_asset_and_lamps_are_told(whole):
    chairs = [thing for thing in whole.things if thing.category == "dining chair"]
    assert len(chairs) == 2
    assert chairs[0].asset is chairs[1].asset
    assert chairs[0].content == chairs[1].content
    assert whole.lights == whole.cameras == ()
    assert whole.left_out == ("no lights: scenes of 3D-FRONT have none, and lamps give no light: 1 floor lamp",)
    assert whole.faults == ()


def test_equal_things_of_other_scenes_have_equal_contents(whole, tmp_path):
    other = load_scene(house(rooms=("LivingDiningRoom-17",), models=("chair", "sofa")).write(tmp_path), tmp_path)
    contents = {thing.category: thing.content for thing in whole.things if thing.role == "object"}
    assert {thing.category: thing.content for thing in other.things if thing.role == "object"} == {
        name: contents[name] for name in ("dining chair", "three-seat/multi-seat sofa")}


def test_names_are_those_of_rooms_and_children_each_once(tmp_path):
    made = house(rooms=("Bedroom-31", "Kitchen-44"), models=("stool",))
    rooms = made.document["scene"]["room"]
    rooms[1]["instanceid"] = "Bedroom-31"
    rooms[1]["children"][0]["instanceid"] = rooms[1]["children"][1]["instanceid"]
    del rooms[1]["children"][2]["instanceid"]
    names = [thing.name for thing in load_scene(made.write(tmp_path), tmp_path).things]
    assert len(set(names)) == len(names)
    assert {"Bedroom-31/mesh/0", "Bedroom-31#2/2", f"Bedroom-31#2/{rooms[1]['children'][1]['instanceid']}#2"} <= set(
        names)


def test_texture_coordinates_take_the_2x2_of_the_transform(tmp_path):
    made = house(**BEDROOM)
    made.material("wood")["UVTransform"] = [[0, 2, 9], [-1, 0, 9], [9, 9, 1]]
    model = load_scene(made.write(tmp_path), tmp_path)
    floor = next(thing for thing in model.things if thing.role == "floor").asset.mesh
    x, y = floor.corners[..., 0], floor.corners[..., 1]  # The house's uv are x and z of the file
    assert floor.uvs == pytest.approx(np.stack([2 * -y, -x], axis=2), abs=1e-5)


def test_colours_are_made_linear(tmp_path):
    model = load_scene(house(**BEDROOM).write(tmp_path), tmp_path)
    wall = next(thing for thing in model.things if thing.category == "wallinner")
    assert wall.asset.materials[0].base_color == pytest.approx((0.8308, 0.8070, 0.7529), abs=1e-4)


def test_the_spec_says_what_belongs_to_the_building(tmp_path):
    source = house(**BEDROOM).write(tmp_path)
    source = source.model_copy(update={"parts": (PartPatterns(part="object", patterns=("*/mesh/7",)),
                                                 PartPatterns(part="walls", patterns=("*furniture*",)))})
    roles = {thing.name: thing.role for thing in load_scene(source, tmp_path).things}
    assert roles["Bedroom-31/mesh/7"] == "object"
    assert {role for name, role in roles.items() if "furniture" in name} == {"walls"}
