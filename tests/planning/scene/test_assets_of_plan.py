"""Assets of plans, and changes to their materials: drawn on their own paths, applied where meant, refused by name."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.procedural.furniture import make_furniture
from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.errors import PlanError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene import assets_of_plan
from dataset_builder.planning.scene.assets_of_plan import asset_of, world_from_object
from dataset_builder.planning.scene.contents import contents
from dataset_builder.planning.scene.material_changes import changed, drawn_changes, matches
from dataset_builder.planning.scene.room_parts import room_parts
from dataset_builder.planning.view.visibility import look
from dataset_builder.spec.mesh_source import companions, mesh_source
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.scene import MaterialSpec, ObjectSpec

TRIANGLES = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n" \
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n" \
    "0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
Load = Callable[..., LoadedSpec]
TEXTURE = Texture(base_color=np.ones((1, 1, 3), np.float32))
OAK = Material(name="top: oak", base_color=(1, 1, 1), texture=TEXTURE)
STEEL = Material(name="frame: steel", base_color=(0.5, 0.5, 0.5), metallic=1.0)


def file_plan(path: Path, **more: object) -> ObjectPlan:
    return ObjectPlan.model_validate({
        "name": "solid", "kind": "file", "source": path.name, "category": "solid",
        "source_sha256": mesh_source(path, companions(path)).digest, "licence": "CC0-1.0",
        "seed": "0", "params": (), "scale": 0.5, "up": "z"} | more)


def test_a_mesh_file_becomes_an_asset_in_metres(tmp_path: Path) -> None:
    path = tmp_path / "solid.ply"
    path.write_text(TRIANGLES)
    asset = asset_of(file_plan(path), tmp_path)
    assert np.ptp(asset.mesh.bounds, axis=0).ravel() == pytest.approx([1, 1, 1]) and asset.category == "solid"
    assert asset_of(file_plan(path), tmp_path) is asset


def test_a_mesh_file_that_changed_after_planning_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "solid.ply"
    path.write_text(TRIANGLES)
    with pytest.raises(PlanError, match="the file, or one that it names, changed after planning"):
        asset_of(file_plan(path, source_sha256="0" * 64), tmp_path)


@pytest.mark.parametrize("name", ["a.mtl", "wood.png"])
def test_a_file_that_the_mesh_names_and_that_changed_or_went_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd wood.png\n")
    Image.new("RGB", (2, 2), "red").save(tmp_path / "wood.png")
    plan = file_plan(tmp_path / "a.obj")
    assert asset_of(plan, tmp_path).name == "solid"
    assets_of_plan.ASSETS.cache_clear()
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes() + b"\n")
    with pytest.raises(PlanError, match="changed after planning"):
        asset_of(plan, tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(PlanError, match=f"got .*{name}"):
        asset_of(plan, tmp_path)


def test_objects_turn_counter_clockwise_then_move(load: Callable[..., LoadedSpec]) -> None:
    plan = contents(load())["train"].objects[0]
    matrix = world_from_object(PlacedObject(object=plan, instance=1, position=(10.0, 20.0, 1.0), yaw=90.0))
    assert matrix @ [1, 0, 0, 1] == pytest.approx([10, 21, 1, 1])
    assert matrix @ [0, 0, 2, 1] == pytest.approx([10, 20, 3, 1])


def test_embedded_furniture_in_embedded_rooms_is_seen_as_planned(load: Callable[..., LoadedSpec],
                                                                 monkeypatch: pytest.MonkeyPatch,
                                                                 tmp_path: Path) -> None:
    monkeypatch.setattr(assets_of_plan, "make_furniture", make_furniture)
    monkeypatch.setattr(assets_of_plan, "make_room", make_room)
    loaded = load()
    planner = Planner(loaded)
    for ref in planner.examples[:12:4]:
        plan, arrangement = planner.example(ref), planner.arrangement(ref.view.pair)
        assert {part.name for part in room_parts(plan.room, tmp_path)} == {"floor", "walls", "ceiling"}
        sight = look(arrangement, Pinhole.of(plan.camera, 64, 64), grid=160)
        assert sight.coverage == pytest.approx(plan.camera.coverage, rel=0.1)
        assert sight.visibility == pytest.approx(plan.camera.visibility, abs=0.05)


def drawn(seed: int = 0, **spec: dict[str, Any]) -> tuple:  # type: ignore[type-arg]
    return drawn_changes({name: MaterialSpec.model_validate(change) for name, change in spec.items()}, seed, ("here",))


def values(changes: tuple, name: str) -> dict[str, float]:  # type: ignore[type-arg]
    return {param.name: param.value for change in changes if change.name == name for param in change.values}


def test_what_is_left_out_stays() -> None:
    made, = changed([OAK], drawn(top={"roughness": 0.25}), "table")
    assert made == replace(OAK, roughness=0.25) or (made.roughness, made.texture, made.base_color) == (
        0.25, TEXTURE, (1, 1, 1))


def test_colours_truths_and_textures() -> None:
    change = {"base_color": [0.1, 0.2, 0.3], "thin": True, "transmission": 1, "plain": True, "sheen": [0, 0.5, 1]}
    made, steel = changed([OAK, STEEL], drawn(top=change), "table")
    assert (made.base_color, made.thin, made.transmission, made.texture) == ((0.1, 0.2, 0.3), True, 1, None)
    assert made.sheen == (0, 0.5, 1) and steel is STEEL
    assert changed([made], drawn(top={"thin": False}), "table")[0].thin is False


def test_an_index_of_refraction_brings_its_reflectance() -> None:
    assert values(drawn(top={"ior": 1.5}), "top")["specular"] == pytest.approx(0.04)
    assert values(drawn(top={"ior": 1.0}), "top")["specular"] == 0
    assert values(drawn(top={"ior": 1.5, "specular": 0.1}), "top")["specular"] == 0.1


def test_each_number_has_its_own_draw() -> None:
    spread = {"uniform": [0, 1]}
    both = values(drawn(top={"roughness": spread, "base_color": [spread] * 3}), "top")
    alone = values(drawn(top={"roughness": spread}), "top")
    other = values(drawn(frame={"roughness": spread}), "frame")
    assert both["roughness"] == alone["roughness"] != other["roughness"]
    assert len(set(both.values())) == 4
    assert values(drawn(1, top={"roughness": spread}), "top") != alone


def test_names_roles_and_patterns() -> None:
    assert all(matches(name, "top: oak") for name in ("top", "top: oak", "*", "top: *", "*: oak"))
    assert not any(matches(name, "top: oak") for name in ("oak", "to", "Top", "frame"))
    both = changed([OAK, STEEL], drawn(**{"*": {"roughness": 0.3}, "frame": {"roughness": 0.6}}), "table")
    assert [made.roughness for made in both] == [0.3, 0.6]


def test_a_name_that_a_mesh_does_not_have_is_refused_with_those_it_has() -> None:
    with pytest.raises(PlanError, match=r"table: materials.tip: .*got 'tip'.*nearest known name: top"):
        changed([replace(OAK, name="top"), STEEL], drawn(tip={"roughness": 1}), "table")
    with pytest.raises(PlanError, match=r"materials\.glass_"):
        changed([OAK], drawn(**{"glass_*": {"roughness": 1}}), "table")


def test_what_another_draw_of_a_family_has_is_no_mistake() -> None:
    roles = ("frame", "top", "books")
    assert changed([OAK], drawn(books={"roughness": 1}, **{"*: pine": {"roughness": 1}}), "table", roles) == (OAK,)


def _chair(load: Load, **materials: Any) -> LoadedSpec:
    spec = ObjectSpec(family="chair", materials={name: MaterialSpec.model_validate(change)
                                                 for name, change in materials.items()})
    return load(objects={"chair.yaml": spec})


def test_a_role_that_a_family_never_has_is_refused_before_anything_is_made(load: Load) -> None:
    with pytest.raises(PlanError, match=r"chair.yaml: materials.leg: .*frame, cover"):
        contents(_chair(load, leg={"roughness": 1}))


def test_plans_hold_the_draws_and_assets_follow_them(load: Load) -> None:
    loaded = _chair(load, **{"*": {"roughness": {"uniform": [0.2, 0.8]}}})
    first, second = (contents(loaded)["train"].objects[k] for k in (0, 2))
    assert values(first.materials, "*") != values(second.materials, "*")
    asset = asset_of(first, Path())
    assert asset.materials[0].roughness == values(first.materials, "*")["roughness"]
    plain = contents(load())["train"].objects[0]
    assert first.params == plain.params and first.seed == plain.seed and plain.materials == ()
