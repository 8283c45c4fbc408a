"""Captures as what is around: a room that is one mesh, and pieces of furniture."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import write_field
from dataset_builder.assets.scene_file import load_scene
from dataset_builder.errors import SpecError
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.scene.triangle_soup import surroundings
from dataset_builder.spec.load import load_dataset
from tests.small_fields import field_of, room, write_ball
from tests.small_specs import write_spec

DATASET = """\
name: small
image: {width: 24, height: 20}
camera: {coverage: [0.05, 0.5]}
splits:
  - name: train
    objects: {count: 1, from: [objects/stool.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
    views: 2
"""
SCENE = "file: {path: room.npz, licence: CC-BY-4.0}\nfurniture:\n  - {object: ../objects/ball.yaml, place: floor}\n"


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    write_ball(tmp_path / "objects" / "ball.npz", radius=0.2)
    (tmp_path / "scenes").mkdir()
    write_field(tmp_path / "scenes" / "room.npz", field_of(room()))
    dimmed = "file: ball.npz\nlicence: CC0-1.0\nmaterials: {capture: {base_color: [0.5, 0.5, 0.5]}}\n"
    return write_spec(tmp_path, {"small.yaml": DATASET, "scenes/den.yaml": SCENE, "objects/ball.yaml": dimmed})


def test_a_captured_room_is_parted_by_how_its_faces_lie(spec: Path) -> None:
    scene = load_scene(SceneSource(source="scenes/room.npz", licence="CC-BY-4.0"), spec.parent)
    parts = {thing.role: thing.asset for thing in scene.things}
    assert set(parts) == {"floor", "walls", "ceiling"}
    floor, ceiling = parts["floor"].mesh, parts["ceiling"].mesh
    assert np.ptp(floor.positions[:, 2]) == 0 == floor.positions[0, 2] and (floor.area_normals[:, 2] > 0).all()
    assert (ceiling.positions[:, 2] == 2.5).all() and (ceiling.area_normals[:, 2] < 0).all()
    # The table, too small to be a floor, goes with the walls
    assert 0.7 in parts["walls"].mesh.positions[:, 2]
    assert sum(len(asset.mesh.faces) for asset in parts.values()) == len(room().faces)
    assert floor.colors is not None and "parted into floor, walls, ceiling" in scene.left_out[-1]


def test_targets_and_furniture_stand_on_its_floor(spec: Path) -> None:
    planner = Planner(load_dataset(spec))
    plan = planner.example(planner.examples[0])
    ball, = plan.furniture
    table = 0.5
    for placed in (plan.target, ball):
        assert placed.position[2] == pytest.approx(0, abs=1e-9)
        assert max(map(abs, placed.position[:2])) > table and max(map(abs, placed.position[:2])) < 2
    assert plan.camera.position[2] < 2.5 and "colours" in plan.effects.features
    dimmed = next(each for each in surroundings(plan, spec.parent).materials if each.base_color == (0.5, 0.5, 0.5))
    assert dimmed.name == "capture" and plan.field.kind == "none"


def test_a_captured_room_is_not_turned(spec: Path) -> None:
    den = spec.parent / "scenes" / "den.yaml"
    den.write_text(SCENE.replace("licence: CC-BY-4.0", "licence: CC-BY-4.0, up: z"))
    with pytest.raises(SpecError, match=r"up: expected no `up` for a \.npz file, got 'z'"):
        load_dataset(spec)
