"""Rooms with materials of their own, and what of them moves what else is drawn: nothing."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from PIL import Image

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.procedural.materials import FAMILIES_OF_FINISHES
from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.errors import PlanError
from dataset_builder.planning.scene import assets_of_plan
from dataset_builder.planning.scene.assets_of_plan import room_shell
from dataset_builder.planning.scene.contents import contents, room_plan
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.scene import FinishName, RoomSpec
from tests.small_specs import FILES, write_spec

Room = Callable[..., dict[str, Asset]]


@pytest.fixture(autouse=True)
def _real_rooms(boxes: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(assets_of_plan, "make_room", make_room)
    yield
    room_shell.cache_clear()


@pytest.fixture
def room(tmp_path: Path) -> Room:
    """The parts of a room with these materials, its textures in the folder of the test."""
    def make(text: str = "") -> dict[str, Asset]:
        loaded = load_dataset(write_spec(tmp_path, {"rooms/den.yaml": FILES["rooms/den.yaml"] + text}))
        return room_shell(room_plan(loaded, "rooms/den.yaml", "room", ("train", "scene", 0, "room")), tmp_path)

    return make


def material(asset: Asset, role: str) -> Material:
    return next(each for each in asset.materials if each.name.startswith(f"{role}: "))


def test_families_of_the_spec_are_those_that_are_made() -> None:
    assert set(get_args(FinishName)) == set(FAMILIES_OF_FINISHES)


def test_a_colour_takes_the_place_of_what_is_drawn_and_moves_nothing_else(room: Room) -> None:
    plain, red = room(), room('materials: {wall: {base_color: "#ff0000"}}\n')
    wall = material(red["walls"], "wall")
    assert wall.texture is None and wall.base_color == (1, 0, 0) and (wall.roughness, wall.specular) == (1, 0)
    for name in ("floor", "walls", "ceiling"):
        for field in ("positions", "faces", "uvs", "material"):
            assert np.array_equal(getattr(plain[name].mesh, field), getattr(red[name].mesh, field))
    for name, role in (("floor", "floor"), ("ceiling", "ceiling")):
        ours, theirs = material(plain[name], role), material(red[name], role)
        assert ours.name == theirs.name and ours.texture is not None and theirs.texture is not None
        assert np.array_equal(ours.texture.base_color, theirs.texture.base_color)
    assert material(plain["walls"], "trim") == material(red["walls"], "trim") or \
        material(plain["walls"], "trim").base_color == material(red["walls"], "trim").base_color


def test_a_texture_repeats_every_so_many_metres(room: Room, tmp_path: Path) -> None:
    """188 of 255 is 0.5029 in linear light; a floor of 4 m and twice 0.1 m of wall is 8.4 repeats of 0.5 m wide."""
    Image.new("RGB", (8, 4), (255, 188, 0)).save(tmp_path / "floor.png")
    floor = room("materials: {floor: {texture: ../floor.png, size: 0.5, roughness: 0.25, base_color: [0.5, 1, 1]}}\n")
    found = material(floor["floor"], "floor")
    assert found.texture is not None and found.texture.base_color.shape == (4, 8, 3)
    assert found.texture.base_color[0, 0] == pytest.approx((1, 0.502886, 0), abs=1e-6) and found.roughness == 0.25
    assert found.base_color == (0.5, 1, 1) and found.texture.roughness is None
    mesh = floor["floor"].mesh
    flat = mesh.positions[mesh.faces][..., 2].min(axis=1) > -1e-9
    assert np.ptp(mesh.uvs[flat][..., 0]) == pytest.approx(8.4, abs=0.01)


def test_a_family_is_made_in_the_tone_asked_for(room: Room) -> None:
    made = room("materials: {floor: {family: boards, tone: oak}, trim: {family: paint, tone: navy, roughness: 1}}\n")
    assert material(made["floor"], "floor").name == "floor: oak boards"
    trim = material(made["walls"], "trim")
    assert trim.name == "trim: navy paint" and trim.roughness == 1


def test_fields_alone_change_what_is_drawn(room: Room) -> None:
    before, after = (material(room(text)["floor"], "floor") for text in ("", "materials: {floor: {coat: 1}}\n"))
    assert (before.name, before.coat, after.coat) == (after.name, 0, 1) and after.texture is not None


def test_an_unknown_tone_is_an_error_that_lists_them(room: Room) -> None:
    with pytest.raises(PlanError, match=r"rooms/den.yaml: materials.wall.tone: expected a tone of plaster, got 'oak' "
                                        r"\(known tones: white, warm white, pale grey"):
        room("materials: {wall: {family: plaster, tone: oak}}\n")


def test_a_texture_that_changed_after_planning_is_refused(room: Room, tmp_path: Path) -> None:
    Image.new("RGB", (4, 4)).save(tmp_path / "a.png")
    text = {"rooms/den.yaml": FILES["rooms/den.yaml"] + "materials: {wall: {texture: ../a.png}}\n"}
    plan = room_plan(load_dataset(write_spec(tmp_path, text)), "rooms/den.yaml", "room", ("a",))
    Image.new("RGB", (4, 4), (9, 9, 9)).save(tmp_path / "a.png")
    with pytest.raises(PlanError, match="the file changed after planning; plan again"):
        room_shell(plan, tmp_path)


def test_numbers_are_drawn_from_paths_of_their_own(load: Any, dataset_data: dict[str, Any]) -> None:
    def rooms(**more: Any) -> list[Any]:
        loaded = load(dataset_data, room={"width": {"uniform": (5, 7)}, "depth": 5, **more})
        return [scene.room for scene in contents(loaded)["train"].scenes]

    rough = {"wall": {"roughness": {"uniform": (0.2, 0.9)}}}
    plain, drawn, both = rooms(), rooms(materials=rough), rooms(materials={"floor": {"coat": 1}, **rough})
    values = [[param.value for param in room.materials[0].values] for room in drawn]
    assert values[0] != values[1] and [room.materials[1] for room in both] == [room.materials[0] for room in drawn]
    assert [room.model_copy(update={"materials": ()}) for room in drawn] == plain
    assert RoomSpec().materials == {}
