"""Scenes of 3D-FRONT in plans: targets that are pieces of furniture, and targets on their free floor."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.arrangement import geometry_of
from dataset_builder.spec.load import load_dataset
from tests.front3d_faults import FAULTS
from tests.front3d_files import House, house
from tests.gltf_scenes import DATASET

SPEC = """\
file:
  path: house.json
  licence: CC0-1.0
  models: models
  textures: textures
"""


def plan(folder: Path, made: House, objects: str) -> ExamplePlan:
    made.write(folder)
    data = DATASET.replace('objects: {things: {name: "*"}, count: 2}', f"objects: {objects}")
    for name, text in {"dataset": data, "scene": SPEC, "stool": "family: stool\n"}.items():
        (folder / f"{name}.yaml").write_text(text)
    planner = Planner(load_dataset(folder / "dataset.yaml"))
    return planner.example(planner.examples[0])


def test_a_mirrored_piece_is_a_target_where_it_stands(tmp_path: Path) -> None:
    """Its tower, at +X of the model, is at -X of the world."""
    made = house(rooms=("Bedroom-31",), models=("lshape", "bed"))
    made.child("lshape").update(scale=[-1, 1, 1], pos=[6, 0, 3])
    FAULTS["centimetres by size"][0](made)
    planned = plan(tmp_path, made, '{things: {category: "corner/side table"}, count: 1}')
    target = planned.target
    assert (planned.room.kind, target.object.thing) == ("front3d", "Bedroom-31/furniture/41")
    assert [each.category for each in planned.room.scene.things] == ["king-size bed"]
    positions, faces, _ = geometry_of(target, tmp_path)
    assert positions.min(axis=0) == pytest.approx([5.7, -3.2, 0], abs=1e-4)
    assert positions.max(axis=0) == pytest.approx([6.3, -2.8, 0.5], abs=1e-4)
    assert positions[positions[:, 2] > 0.4][:, 0].max() == pytest.approx(5.9, abs=1e-4)
    a, b, c = np.moveaxis(positions[faces], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(0.072, rel=1e-4)
    said = {each.choice: each.reason for each in planned.effects.decisions if each.effect == "scene file"}
    assert said["faults"].startswith("models in centimetres, brought to metres (1): aaaa0000-lshape (")
    assert said["left out"].startswith("no lights: scenes of 3D-FRONT have none")


def test_an_object_stands_on_free_floor_of_an_l_shaped_room(tmp_path: Path) -> None:
    """Not in the corner that the L leaves out, and in no piece of furniture."""
    planned = plan(tmp_path, house(rooms=("LivingDiningRoom-17",), models=("sofa", "dining_table")),
                   "{from: [stool.yaml], count: 1}")
    x, y, z = planned.target.position
    assert 0.06 < x < 4.94 and 0.06 < -y < 6.94 and z == pytest.approx(0, abs=1e-3)
    assert x < 2.44 or -y < 3.94
    assert [each.category for each in planned.room.scene.things] == ["three-seat/multi-seat sofa", "dining table"]
