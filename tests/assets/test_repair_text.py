"""What repair did to a mesh file reaches the plan, in words."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.repair_text import pieces_text, repair_notes, repair_text
from dataset_builder.geometry.mesh import concatenate
from dataset_builder.geometry.repair import repair
from dataset_builder.label.scene_plan import FogPlan, PlacedObject
from dataset_builder.planning.effects import materials_used
from dataset_builder.planning.effects.features import scene_features
from dataset_builder.planning.effects.materials_used import scene_use
from tests.geometry.conftest import box, mesh_of
from tests.plans import example_plan


def write_obj(path: Path, faces: np.ndarray) -> Path:
    """The unit cube with the faces given, every one with vertices of its own."""
    corners = box().positions[faces].reshape(-1, 3)
    lines = [*(f"v {x:g} {y:g} {z:g}" for x, y, z in corners),
             *(f"f {3 * n + 1} {3 * n + 2} {3 * n + 3}" for n in range(len(faces)))]
    path.write_text("\n".join(lines) + "\n")
    return path


def load(path: Path) -> Asset:
    return load_mesh_file(path, name="cube", category="chair", licence="CC0-1.0")


def test_a_sound_file_is_repaired_without_a_word(tmp_path: Path) -> None:
    meta = load(write_obj(tmp_path / "cube.obj", box().faces)).meta
    assert meta["repair"] == "28 vertices welded" and meta["shape"] == ""
    assert meta["contains"].endswith("; 1 piece, closed: 1")


def test_a_cube_inside_out_is_turned_and_named(tmp_path: Path) -> None:
    faces = box().faces[:, ::-1].copy()
    faces[4] = faces[4, ::-1]
    asset = load(write_obj(tmp_path / "cube.obj", faces))
    assert asset.mesh.volume == pytest.approx(1)
    assert asset.meta["repair"].endswith("1 faces turned that wound against their neighbours, 1 closed pieces turned "
                                         "outwards") and asset.meta["shape"] == ""


def test_loose_triangles_are_named(tmp_path: Path) -> None:
    """A staircase of triangles, none of which touches another."""
    lines = [f"v {n} {n} {n}\nv {n + 0.5} {n} {n}\nv {n} {n + 0.5} {n}\nf -3 -2 -1" for n in range(20)]
    (tmp_path / "stairs.ply").write_text("\n".join(
        ["ply", "format ascii 1.0", "element vertex 60", *(f"property float {axis}" for axis in "xyz"),
         "element face 20", "property list uchar int vertex_indices", "end_header",
         *(line[2:] for text in lines for line in text.split("\n")[:3]),
         *(f"3 {3 * n} {3 * n + 1} {3 * n + 2}" for n in range(20))]) + "\n")
    assert "falls apart into 20 loose pieces" in load(tmp_path / "stairs.ply").meta["shape"]


def test_the_plan_has_the_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under the object's name; what there is nothing to say of is left out."""
    cube = Asset(name="cube", category="chair", mesh=box(), materials=(Material(name="plain", base_color=(1, 1, 1)),),
                 meta={"contains": "6 faces", "left_out": "", "repair": "3 welded", "shape": "odd"})
    monkeypatch.setattr(materials_used, "asset_of", lambda *_: cube)
    facts = materials_used._Facts(materials=(), figures=(), smooth=False)
    monkeypatch.setattr(materials_used, "_facts", lambda _: facts)
    plan = example_plan()
    use = scene_use(plan.room, [PlacedObject(object=plan.target.object, instance=1, position=(0, 0, 0), yaw=0)], Path())
    decisions = scene_features(use, FogPlan(), example_plan().render)[1]
    told = [(one.choice, one.reason) for one in decisions if one.effect == "mesh file"]
    assert told == [("contains", "train-stool-00: 6 faces"), ("repair", "train-stool-00: 3 welded"),
                    ("shape", "train-stool-00: odd")]


def test_the_parts_to_which_most_was_done_are_told() -> None:
    """Six boxes one apart, the n-th with n faces that stand twice."""
    boxes = [mesh_of(box().positions + np.array((2 * n, 0, 0)), np.concatenate([box().faces, box().faces[:n]]))
             for n in range(6)]
    sizes = [len(mesh.faces) for mesh in boxes]
    _, report = repair(concatenate(boxes), part=np.repeat(np.arange(6), sizes))
    text = repair_text(report, [f"part {n}" for n in range(6)])
    assert text == ("15 duplicate faces dropped; part 5: 5 duplicate; part 4: 4 duplicate; part 3: 3 duplicate; and 2 "
                    "more parts")
    assert repair_notes(report) == [] and pieces_text(report) == "6 pieces, closed: 6"
