"""What specs may say of lamps that are placed, and of materials of rooms."""

from collections.abc import Callable
from typing import Any

import pytest
from pydantic import ValidationError

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import SpecError
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.light import TargetSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.spec_files import SpecFiles

LEFT = {"name": "left", "position": (-1.0, 0.0, 1.5)}
Change = Callable[..., Any]


def target(*lamps: dict[str, Any], **more: Any) -> TargetSpec:
    return TargetSpec.model_validate({"lights": lamps, **more}, strict=True)


@pytest.mark.parametrize(("lamp", "rule"), [
    ({}, "exactly one of `position` and `azimuth`, got neither"),
    ({"position": (0, 0, 1), "azimuth": 3}, "exactly one of `position` and `azimuth`, got both"),
    ({"position": (0, 0, 1), "distance": 2}, "no `distance` beside `position`"),
    ({"azimuth": 0, "strength": 1, "radiance": 1}, "no `radiance` beside `strength`"),
    ({"azimuth": 0, "temperature": 3000, "color": "#ffffff"}, "no `color` beside `temperature`"),
    ({"azimuth": 0, "color": "red"}, "three numbers or '#' and six hexadecimal digits"),
    ({"azimuth": 0, "color": None}, "got nothing: without quotes, YAML takes # for the beginning of a comment"),
    ({"azimuth": 0, "color": "#000000"}, "a color with a number that is not 0"),
    ({"azimuth": 0, "direction": (0, 0, 0)}, "a direction with a number that is not 0"),
    ({"azimuth": 0, "direction": (0, 0, 1), "aim": (1, 0, 0)}, "no `aim` beside `direction`"),
    ({"position": (0, 0, 1), "aim": (0, 0, 1)}, "expected a point other than `position`"),
    ({"azimuth": 0, "aim": "me"}, r"`object` or a point \[x, y, z\]"),
    ({"azimuth": 0, "kind": "point", "size": 0.1}, "no `size` of a light of kind point"),
    ({"azimuth": 0, "kind": "area", "cutoff": 30}, "no `cutoff` of a light of kind area"),
    ({"azimuth": 0, "kind": "sphere", "texture": "a.png"}, "no `texture` of a light of kind sphere"),
    ({"azimuth": 0, "kind": "sphere", "aim": (0, 0, 1)}, "no `aim` of a light of kind sphere"),
    ({"azimuth": 0, "on": False}, "expected a lamp that is on, got none"),
    ({"azimuth": 0, "dim": 0}, "expected a lamp that is on, got none")])
def test_a_lamp_is_said_once_and_of_its_kind(lamp: dict[str, Any], rule: str) -> None:
    with pytest.raises(ValidationError, match=rule):
        target(lamp)


def test_lamps_are_told_apart_and_have_kinds_of_their_own() -> None:
    with pytest.raises(ValidationError, match="names of lamps to differ, got left again"):
        target(LEFT, LEFT)
    with pytest.raises(ValidationError, match="a `kind` of every lamp beside `kinds`, which is about random lights"):
        target(LEFT, kinds=("spot",))
    assert target({**LEFT, "kind": "area"}, kinds=("spot",)).lamps[0].kind == "area"
    with pytest.raises(ValidationError, match="no `textures` beside a list of lamps"):
        target(LEFT, textures=("a.png",))


def test_a_colour_in_digits_is_linear() -> None:
    """Half of sRGB's range, 188 of 255, is 0.5029 of its light (IEC 61966-2-1, by hand)."""
    assert target({"azimuth": 0, "color": "#00bcff"}).lamps[0].color == pytest.approx((0, 0.502886, 1), abs=1e-6)


def test_what_is_drawn_of_lamps_is_what_they_use() -> None:
    fixed: dict[str, Any] = {**LEFT, "strength": 1}
    spread = {"uniform": (1.0, 2.0)}
    assert not target(fixed).drawn and target({**fixed, "dim": spread}).drawn and target(LEFT, strength=spread).drawn
    assert not target(fixed, strength=spread, elevation=spread, cutoff=spread).drawn
    assert not target(fixed, {"azimuth": 0, "dim": spread, "on": False}).drawn and target(fixed, dome=spread).drawn
    assert not target({**fixed, "dim": {"uniform": (1.0, 1.0)}}).drawn and TargetSpec().drawn


def test_each_is_one_light_for_every_lamp_that_is_on() -> None:
    three = target(LEFT, {"azimuth": 0, "on": False}, {"azimuth": 9})
    assert three.alone_of("each") == (0, 2) and three.count_of("each") == 2
    assert three.count_of(5) == 5 and three.alone_of(5) == ()
    split = {"name": "a", "objects": {"from": ["o.yaml"], "count": 1}, "scenes": {"from": ["s.yaml"], "count": 1}}
    with pytest.raises(ValidationError, match=r"a list of lamps in `target\.lights`, each to shine alone"):
        DatasetSpec.model_validate({"name": "a", "splits": [{**split, "lights": "each"}]})


def test_equal_lights_of_a_view_are_refused_with_their_line(in_folder: Change) -> None:
    text = in_folder().read_text()
    lamp = "target: {lights: [{position: [0, 0, 1.5], strength: 1}]}\n"
    two = text.replace("  - name: test\n", "  - name: test\n    lights: 2\n")
    with pytest.raises(SpecError) as caught:
        load_dataset(in_folder(**{"tiny.yaml": two + lamp}))
    line = two.splitlines().index("    lights: 2") + 1
    assert str(caught.value) == (
        f"tiny.yaml:{line}: splits[1].lights: expected 1 or each, since nothing about the lamps of `target` is drawn "
        "and all lights of a view would be equal, got 2 (draw a number of a lamp, as `dim: {uniform: [0.5, 1]}`)")
    load_dataset(in_folder(**{"tiny.yaml": two + lamp.replace("1}]", "{uniform: [1, 2]}}]")}))
    load_dataset(in_folder(**{"tiny.yaml": two.replace("lights: 2", "lights: each") + lamp}))


def test_images_of_lamps_and_rooms_are_part_of_the_spec(tiny: Change) -> None:
    files = {"tiny.yaml": tiny().read_text() + "target: {lights: [{azimuth: 0, texture: a.png}]}\n", "a.png": "a",
             "rooms/den.yaml": "materials: {wall: {texture: ../b.jpg}}\n", "b.jpg": "b"}
    first = load_dataset(tiny(**files))
    assert first.images == {"a.png": sha256_bytes(b"a"), "b.jpg": sha256_bytes(b"b")}
    assert first.rooms["rooms/den.yaml"].materials["wall"].texture == "b.jpg"
    assert {"a.png", "b.jpg"} < set(SpecFiles.of(first).files)
    second = load_dataset(tiny(**{**files, "b.jpg": "other"}))
    split = first.dataset.splits[0]
    assert first.spec_digest != second.spec_digest and first.split_digest(split, 0) != second.split_digest(split, 0)


@pytest.mark.parametrize(("room", "said"), [
    ("materials: {walls: {coat: 1}}", "materials.walls: expected 'wall', 'floor', 'ceiling' or 'trim', got 'walls'"),
    ("materials: {wall: {transmission: 1}}", "materials.wall.transmission: expected no such key, got 1"),
    ("materials: {wall: {family: brick}}", "materials.wall.family: expected 'plaster', 'paint', 'boards'"),
    ("materials: {wall: {tone: oak}}", "materials.wall.tone: expected a `family` beside `tone`"),
    ("materials: {wall: {family: wood, size: 1}}", "materials.wall.size: expected a `texture` beside `size`"),
    ("materials: {wall: {family: wood, texture: a.png}}", "materials.wall.texture: expected `family` or `texture`"),
    ("materials: {wall: {texture: none.png}}", "wall.texture: expected an image, found none at 'rooms/none.png'"),
    ("materials: {wall: {texture: den.yaml}}", "expected a file that ends in one of .png .jpg"),
    ("ceiling: false\nmaterials: {ceiling: {roughness: 1}}", "no material of a ceiling in a room without one")])
def test_a_wrong_material_of_a_room_is_named_with_its_line(in_folder: Change, room: str, said: str) -> None:
    with pytest.raises(SpecError) as caught:
        load_dataset(in_folder(**{"rooms/den.yaml": room + "\n"}))
    assert f"rooms/den.yaml:{len(room.splitlines())}: " in str(caught.value) and said in str(caught.value)
