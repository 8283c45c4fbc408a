from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dataset_builder.assets.procedural.furniture import make_furniture
from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.errors import PlanError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene import assets_of_plan
from dataset_builder.planning.scene.assets_of_plan import asset_of, room_parts, world_from_object
from dataset_builder.planning.scene.contents import contents
from dataset_builder.planning.view.visibility import look
from dataset_builder.spec.loaded import LoadedSpec
from dataset_builder.spec.mesh_source import companions, mesh_source

TRIANGLES = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n" \
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n" \
    "0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"


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
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd wood.png\n")
    Image.new("RGB", (2, 2), "red").save(tmp_path / "wood.png")
    plan = file_plan(tmp_path / "a.obj")
    assert asset_of(plan, tmp_path).name == "solid"
    assets_of_plan.asset_of.cache_clear()
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
                                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assets_of_plan, "make_furniture", make_furniture)
    monkeypatch.setattr(assets_of_plan, "make_room", make_room)
    loaded = load()
    planner = Planner(loaded)
    for ref in planner.examples[:12:4]:
        plan, arrangement = planner.example(ref), planner.arrangement(ref.view.pair)
        assert set(room_parts(plan.room)) == {"floor", "walls", "ceiling"}
        sight = look(arrangement, Pinhole.of(plan.camera, 64, 64), grid=160)
        assert sight.coverage == pytest.approx(plan.camera.coverage, rel=0.1)
        assert sight.visibility == pytest.approx(plan.camera.visibility, abs=0.05)
