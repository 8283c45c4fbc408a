"""Furniture and rooms of boxes, so that planning is tested without the embedded assets, and specs made in code."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.planning.scene import assets_of_plan
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.scene import ObjectSpec, RoomSpec, SceneSpec

FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])
Box = tuple[tuple[float, float, float], tuple[float, float, float]]


def box_mesh(low: tuple[float, ...], high: tuple[float, ...]) -> TriangleMesh:
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    return TriangleMesh(positions=corners, faces=FACES, uvs=np.zeros((12, 3, 2)), material=np.zeros(12, int))


def box_asset(name: str, low: tuple[float, ...], high: tuple[float, ...]) -> Asset:
    return Asset(name=name, category="box", mesh=box_mesh(low, high),
                 materials=(Material(name="grey", base_color=(0.5, 0.5, 0.5)),))


def _furniture(*, family: str, params: dict[str, float], seed: int, name: str) -> Asset:
    width, depth = params.get("width", 0.5), params.get("depth", 0.5)
    height = max([value for key, value in params.items() if "height" in key], default=0.7)
    return box_asset(name, (-width / 2, -depth / 2, 0.0), (width / 2, depth / 2, height))


def _room(*, width: float, depth: float, height: float, ceiling: bool, windows: int, skirting: float,
          seed: int, finish: object) -> dict[str, Asset]:
    x, y = width / 2, depth / 2
    parts = {"floor": box_asset("floor", (-x, -y, -0.1), (x, y, 0.0)),
             "walls": box_asset("walls", (-x - 0.1, -y, 0.0), (-x, y, height))}
    return parts | ({"ceiling": box_asset("ceiling", (-x, -y, height), (x, y, height + 0.1))} if ceiling else {})


def _forget() -> None:
    assets_of_plan.ASSETS.cache_clear()
    assets_of_plan.room_shell.cache_clear()


@pytest.fixture(autouse=True)
def boxes(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Boxes instead of furniture; nothing of them stays behind."""
    _forget()
    monkeypatch.setattr(assets_of_plan, "make_furniture", _furniture)
    monkeypatch.setattr(assets_of_plan, "make_room", _room)
    yield
    _forget()


def dataset_data() -> dict[str, Any]:
    return {
        "name": "test", "seed": 5, "camera": {"azimuth": {"uniform": [-180, 180]}, "elevation": {"uniform": [5, 40]}},
        "target": {"strength": {"uniform": [1, 3]}, "temperature": {"uniform": [2500, 7000]},
                   "elevation": {"uniform": [20, 70]}},
        "rough": {"sigma": [{"uniform": [0.001, 0.01]}, 0.0]},
        "splits": [
            {"name": "train", "objects": {"from": ["chair.yaml", "stool.yaml"], "count": 3},
             "scenes": {"from": ["scene.yaml"], "count": 2}, "views": 2, "lights": 2},
            {"name": "eval", "objects": {"from": ["chair.yaml"], "count": 2},
             "scenes": {"from": ["scene.yaml"], "count": 1}, "views": 1, "lights": 1}]}


def scene_data() -> dict[str, Any]:
    return {"room": "room.yaml", "furniture": [{"object": "stool.yaml", "place": "near"},
                                               {"object": "cabinet.yaml", "place": "wall", "count": {"choice": [1, 2]}},
                                               {"object": "chair.yaml", "place": "floor"}]}


Load = Callable[..., LoadedSpec]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Makes a LoadedSpec of a dataset, a scene and a room (plain data), with objects chair, stool and cabinet."""

    def make(dataset: dict[str, Any] | None = None, scene: dict[str, Any] | None = None,
             room: dict[str, Any] | None = None, **more: Any) -> LoadedSpec:
        objects = {f"{family}.yaml": ObjectSpec(family=family) for family in ("chair", "stool", "cabinet")}
        return LoadedSpec(path=tmp_path / "dataset.yaml", dataset=DatasetSpec.model_validate(dataset or dataset_data()),
                          objects=objects | more.pop("objects", {}), meshes=more.pop("meshes", {}), images={},
                          scenes={"scene.yaml": SceneSpec.model_validate(scene or scene_data())},
                          rooms={"room.yaml": RoomSpec.model_validate(room or {"width": 6, "depth": 5, "height": 2.8})})

    return make


def room_of(width: float = 6.0, depth: float = 5.0, height: float = 2.8) -> RoomPlan:
    return RoomPlan(name="room", seed="0", width=width, depth=depth, height=height, ceiling=True, windows=0,
                    skirting=0.0)


def box_arrangement(target: Box, others: tuple[Box, ...] = (), room: RoomPlan | None = None, *, closed: bool = True,
                    yaw: float = 0.0) -> Arrangement:
    """A target box and other boxes, which are furniture, in a closed box of a room, or in the open."""
    room = room or room_of()
    plan = ObjectPlan(name="box", kind="procedural", source="box", source_sha256="", category="box", licence="CC0-1.0",
                      seed="0", params=(), scale=1.0, up="z")
    shell = ((-room.width / 2, -room.depth / 2, 0.0), (room.width / 2, room.depth / 2, room.height))
    parts = [(target, 1), *((other, 3 + k) for k, other in enumerate(others)), *([(shell, 2)] if closed else [])]
    geometry = tuple((np.array(box_mesh(*box).positions), FACES, instance) for box, instance in parts)
    placed = PlacedObject(object=plan, instance=1, position=(0.0, 0.0, 0.0), yaw=yaw)
    return Arrangement(room=room, target=placed, furniture=(), geometry=geometry, shell=BoxShell(room))


@pytest.fixture(name="box_arrangement")
def _box_arrangement() -> Callable[..., Arrangement]:
    return box_arrangement


@pytest.fixture(name="room_of")
def _room_of() -> Callable[..., RoomPlan]:
    return room_of


@pytest.fixture(name="dataset_data")
def _dataset_data() -> dict[str, Any]:
    return dataset_data()


@pytest.fixture(name="scene_data")
def _scene_data() -> dict[str, Any]:
    return scene_data()
