"""Groups of things that a spec names in full: they are one target, one slot, and go together."""

from pathlib import Path

import pytest

from dataset_builder.errors import UserError
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import probe
from dataset_builder.spec.load import load_dataset

pytest.importorskip("pxr", reason="needs the extra usd")

BOX = """def Xform "{name}" {{
    double3 xformOp:translate = ({x}, {y}, 0.25)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Cube "Shape" {{
        double size = 0.5
    }}
}}
"""
STAGE = f"""#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World" {{
    def Xform "Set" {{
        {BOX.format(name="Left", x=-0.6, y=0)}
        {BOX.format(name="Right", x=0.6, y=0)}
    }}
    {BOX.format(name="Other", x=0, y=2)}
    def Mesh "Floor" {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)]
        uniform token subdivisionScheme = "none"
    }}
}}
"""


def planner(folder: Path, objects: str, more: str = "") -> Planner:
    """Of a dataset of the stage, with views from outside of it."""
    (folder / "stage.usda").write_text(STAGE)
    (folder / "box.yaml").write_text("family: stool\n")
    (folder / "scene.yaml").write_text(f"file:\n  path: stage.usda\n  licence: CC0-1.0\n{more}")
    (folder / "set.yaml").write_text(
        f"name: groups\nsplits:\n  - name: train\n    objects: {objects}\n"
        "    scenes: {from: [scene.yaml], count: 1}\n")
    return Planner(load_dataset(folder / "set.yaml"))


def around(made: Planner) -> tuple[set[str], set[str]]:
    """Names of what is there beside the target, and of what is taken away."""
    room = made.arrangement(made.examples[0].view.pair).room
    return {thing.name for thing in room.scene.things}, set(room.scene.hidden)


def test_a_group_that_is_named_in_full_is_one_target(tmp_path: Path) -> None:
    made = planner(tmp_path, "{things: {name: /World/Set}, count: 1}")
    arrangement = made.arrangement(made.examples[0].view.pair)
    assert arrangement.target.object.thing == "/World/Set"
    assert around(made) == ({"/World/Other"}, {"/World/Set"})
    # Two boxes of half a metre, 1.2 m apart
    assert arrangement.radius == pytest.approx((1.7**2 + 0.5**2 + 0.5**2) ** 0.5 / 2, abs=1e-3)


def test_a_pattern_means_each_of_a_group(tmp_path: Path) -> None:
    made = planner(tmp_path, "{things: {name: /World/Set/*}, count: 2}")
    assert around(made)[1] < {"/World/Set/Left", "/World/Set/Right"}


def test_a_group_goes_with_all_that_is_in_it(tmp_path: Path) -> None:
    made = planner(tmp_path, "{things: {}, count: 1}", "  leave_out: [/World/Set]\n")
    assert around(made) == (set(), {"/World/Set/Left", "/World/Set/Right", "/World/Other"})
    with pytest.raises(UserError, match=r"file.leave_out\[0\]: expected the name of a thing .* got '/World/Sett'"):
        probe(planner(tmp_path, "{things: {}, count: 1}", "  leave_out: [/World/Sett]\n"))


def test_a_group_gives_up_its_place_as_one(tmp_path: Path) -> None:
    made = planner(tmp_path, "{from: [box.yaml], count: 1}", "  slot: {name: /World/Set}\n")
    arrangement = made.arrangement(made.examples[0].view.pair)
    assert around(made) == ({"/World/Other"}, {"/World/Set"})
    assert arrangement.target.position == pytest.approx((0, 0, 0), abs=1e-3)
