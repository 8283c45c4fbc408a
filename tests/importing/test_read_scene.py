"""What the index keeps of a house, and its plan seen from above: areas, places and cuts worked out by hand."""

import json
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.scene_readers.front3d import read
from dataset_builder.importing.read_scene import FloorPlan, floor_plan, read_scene
from dataset_builder.importing.scene_index import RoomIndex, SceneIndex, index_line, scene_of_line
from tests.front3d_files import DOORS, FLOORS, HEIGHT, WINDOWS, House, house, jid_of


def indexed(made: House, folder: Path) -> SceneIndex:
    (folder / "house.json").write_text(json.dumps(made.document))
    return read_scene(folder / "house.json", "0" * 64)[0]


def rooms_of(made: House, folder: Path) -> dict[str, RoomIndex]:
    return {room.name: room for room in indexed(made, folder).rooms}


def area(name: str) -> float:
    return sum((x1 - x0) * (z1 - z0) for (x0, z0), (x1, z1) in FLOORS[name])


def test_rooms_with_their_areas_and_furniture(tmp_path: Path) -> None:
    made = house()
    scene = indexed(made, tmp_path)
    assert scene.uid == "aaaa-house" and scene.size == (tmp_path / "house.json").stat().st_size
    assert {room.name: room.area for room in scene.rooms} == {name: pytest.approx(area(name), abs=0.01)
                                                              for name in FLOORS}
    kitchen = scene.rooms[2]
    assert (kitchen.kind, [piece.jid for piece in kitchen.pieces]) == ("Kitchen", [jid_of("cabinet"), jid_of("stool")])
    assert all(piece.valid and piece.bottom == 0 for room in scene.rooms for piece in room.pieces)
    assert kitchen.pieces[0].sizes == (tuple(made.entry("cabinet")["size"]),)
    assert not scene.faults


def test_a_line_is_the_scene_again(tmp_path: Path) -> None:
    made = house()
    made.document["mesh"][0]["faces"][0] = 99
    made.document["scene"]["room"][0]["instanceid"] = "K\u00fcche \u53a8\u623f"
    (tmp_path / "house.json").write_text(json.dumps(made.document))
    scene, faults = read_scene(tmp_path / "house.json", "ab")
    line = index_line(scene, faults)
    assert "\n" not in line and scene_of_line(line) == (scene, faults) and faults
    for cut in range(0, len(line), 97):
        with pytest.raises(ValueError, match="no line of an index"):
            scene_of_line(line[:cut])


def test_areas_follow_placements_and_not_slabs(tmp_path: Path) -> None:
    """A room turned about the vertical keeps its area; one scaled does not; the lower side of a floor adds nothing."""
    made = house()
    living, bedroom, kitchen = made.document["scene"]["room"]
    living["rot"] = [0, 0.38268, 0, 0.92388]
    bedroom["scale"] = [1, 1, -2]
    floor = next(mesh for child in kitchen["children"] for mesh in made.document["mesh"]
                 if mesh["uid"] == child["ref"] and mesh["type"] == "Floor")
    floor["faces"] += floor["faces"][::-1]
    assert {name: room.area for name, room in rooms_of(made, tmp_path).items()} == {
        name: pytest.approx(factor * area(name), rel=1e-3) for name, factor in zip(FLOORS, (1, 2, 1), strict=True)}


def test_faults_are_told_in_the_words_of_the_reader(tmp_path: Path) -> None:
    """Whatever the index counts, the reader of the whole scene names as well."""
    made = house()
    made.entry("bed")["valid"] = False
    del made.entry("stool")["valid"]
    made.child("sofa")["rot"] = [0, 0, 0, 2]
    room = made.room("Bedroom-31")
    floors = {mesh["uid"] for mesh in made.document["mesh"] if mesh["type"] == "Floor"}
    room["children"] = [child for child in room["children"] if child["ref"] not in floors]
    room["children"].append({"ref": "nowhere", "pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1]})
    source = made.write(tmp_path)
    scene, faults = read_scene(tmp_path / "house.json", "")
    assert scene.faults == {
        "pieces of furniture that were not published, left out": 2, "references to nothing, left out": 1,
        "rooms without a floor": 1, "rotations of another length than 1, made 1": 1}
    assert sum(scene.faults.values()) == len(faults)
    told = " ".join(read(source, tmp_path, 16).faults)
    assert all(f"{kind} ({count})" in told for kind, count in scene.faults.items())
    assert [room.area for room in scene.rooms if room.name == "Bedroom-31"] == [0]


def test_a_file_that_is_no_scene_is_broken(tmp_path: Path) -> None:
    for number, text in enumerate(("", "[]", "{}", '{"scene": 3}', json.dumps(house().document)[:-9])):
        (tmp_path / "no.json").write_text(text)
        scene, faults = read_scene(tmp_path / "no.json", "ab")
        assert scene.broken and not scene.rooms and not faults, number
        assert isinstance(floor_plan(tmp_path / "no.json"), str)


def test_walls_are_cut_below_windows_and_through_them(tmp_path: Path) -> None:
    """What walls are longer below the sills than above is the width of the windows, on both sides of each wall."""
    (tmp_path / "house.json").write_text(json.dumps(house().document))
    plan = floor_plan(tmp_path / "house.json")
    assert isinstance(plan, FloorPlan) and HEIGHT > 2

    def total(segments: np.ndarray) -> float:
        return float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum())

    def width(openings: dict[tuple[tuple[float, float], tuple[float, float]], object]) -> float:
        return sum(float(np.hypot(b[0] - a[0], b[1] - a[1])) for a, b in openings)

    assert total(plan.low_walls) - total(plan.walls) == pytest.approx(2 * width(WINDOWS), abs=1e-6)
    # Doors are 0.9 m wide, and nothing is nearer to their middles than their sides
    for start, end in DOORS:
        middle = np.array([(start[0] + end[0]) / 2, -(start[1] + end[1]) / 2])
        assert nearest(plan.low_walls, middle) == pytest.approx(0.45, abs=0.02)
    for start, end in WINDOWS:
        middle = np.array([(start[0] + end[0]) / 2, -(start[1] + end[1]) / 2])
        assert nearest(plan.low_walls, middle) < 0.1 < 0.7 < nearest(plan.walls, middle)


def nearest(segments: np.ndarray, point: np.ndarray) -> float:
    """Distance of a point from the nearest segment."""
    along = segments[:, 1] - segments[:, 0]
    share = ((point - segments[:, 0]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    feet = segments[:, 0] + np.clip(share, 0, 1)[:, None] * along
    return float(np.linalg.norm(feet - point, axis=1).min())


def test_boxes_lie_where_furniture_stands(tmp_path: Path) -> None:
    """Seen from above with y upwards: the file's z points down, and the front of the model is its +Z."""
    made = house()
    (tmp_path / "house.json").write_text(json.dumps(made.document))
    plan = floor_plan(tmp_path / "house.json")
    assert isinstance(plan, FloorPlan)
    boxes = {box.jid: box for room in plan.rooms for box in room.furniture}
    bed, shelf = boxes[jid_of("bed")], boxes[jid_of("bookshelf")]
    width, depth, height = made.entry("bed")["size"]
    assert bed.corners.mean(axis=0) == pytest.approx([7.0, -1.3]) and bed.top == pytest.approx(height)
    assert bed.corners[:2].mean(axis=0) == pytest.approx([7.0, -1.3 - depth / 2])
    assert np.ptp(bed.corners[:, 0]) == pytest.approx(width)
    # Turned by -90 degrees about +Y, its front looks to -X
    width, depth, _ = made.entry("bookshelf")["size"]
    assert shelf.corners[:2].mean(axis=0) == pytest.approx([4.65 - depth / 2, -3.2], abs=1e-4)
    assert np.ptp(shelf.corners, axis=0) == pytest.approx([depth, width], abs=1e-4)
