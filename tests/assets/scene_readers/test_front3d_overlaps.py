"""Pieces of furniture in each other and in walls."""

import pytest

from dataset_builder.assets.scene_file import load_scene
from tests.front3d_files import house

IN_EACH_OTHER, IN_WALLS = ("pieces of furniture that stand in " + what for what in ("each other", "walls"))


def faults(folder, made):
    return " ".join(load_scene(made.write(folder), folder, max_texture=16).faults)


@pytest.mark.parametrize(("x", "y", "found"), [
    # Over the low end of the other, in the corner of its L: their boxes meet, they do not
    (-0.4, 0.21, False), (-0.4, 0.1, True),
    # Beside it, and 1, 3 and 30 cm into it
    (0.61, 0, False), (0.59, 0, False), (0.57, 0, True), (0.3, 0, True),
])
def test_pieces_may_touch_and_boxes_meet(tmp_path, x, y, found):
    made = house(rooms=("Bedroom-31",), models=("lshape",))
    made.child("lshape")["pos"] = [7, 0, 2]
    made.room("Bedroom-31")["children"].append(
        {**made.child("lshape"), "pos": [7 + x, y, 2.05], "instanceid": "furniture/other"})
    said = faults(tmp_path, made)
    assert (IN_EACH_OTHER in said) == found
    assert ("Bedroom-31/furniture/40 and Bedroom-31/furniture/other" in said) == found
    assert IN_WALLS not in said


@pytest.mark.parametrize(("z", "found"), [(0.3, False), (0.25, False), (0.22, True), (0.1, True)])
def test_pieces_may_touch_walls(tmp_path, z, found):
    """0.4 m deep; the wall's inner face is at z = 0.06."""
    made = house(rooms=("Bedroom-31",), models=("lshape",))
    made.child("lshape")["pos"] = [7, 0.2, z]
    assert (IN_WALLS in faults(tmp_path, made)) == found


def test_what_is_not_honoured_is_left_out_in_words(tmp_path):
    made = house(rooms=("Bedroom-31",), models=("lshape",))
    made.document["extension"].update(snapshots=[{"camera": 1}], perspective_view={"link": ["x", "y"]})
    for material in made.document["material"]:
        material["normaltexture"] = "https://example.com/normal.png"
    made.files["models/aaaa0000-lshape/model.mtl"] += b"sharpness 60\n"
    left_out = load_scene(made.write(tmp_path), tmp_path, max_texture=16).left_out
    assert left_out[1:] == (
        "images of normals of 3 materials", "3 views in extension, which are no cameras of a known kind",
        "models of which statements are not honoured (1): aaaa0000-lshape (paint: sharpness)")
