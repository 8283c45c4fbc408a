"""Which files a mesh file names, in the words of OBJ, MTL and glTF."""

import json
from pathlib import Path

import pytest

from dataset_builder.spec.mesh_source import companions, references


@pytest.mark.parametrize(("written", "name"), [
    ("wood.png", "wood.png"), ("old oak.png", "old oak.png"), ("-s 1 1 1 old oak.png", "old oak.png"),
    ("-o 0.5 wood.png", "wood.png"), ("-t 1e-3 -.5 0 2.png", "2.png"), ("-mm 0 1 -bm 0.2 -imfchan r b.png", "b.png"),
    ("-blendu off -clamp on  sub/w.png", "sub/w.png"), ("-s 1 1 1 4k wood.png", "4k wood.png"),
])
def test_options_come_before_the_name_of_a_map(tmp_path: Path, written: str, name: str) -> None:
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n")
    (tmp_path / "a.mtl").write_text(f"newmtl m\n  map_Bump {written} \n")
    assert companions(tmp_path / "a.obj") == tuple(sorted(("a.mtl", name)))


def test_what_is_written_and_where_it_lies(tmp_path: Path) -> None:
    (tmp_path / "mats").mkdir()
    (tmp_path / "a.obj").write_text("# mtllib no.mtl\nmtllib mats/a.mtl\nv 0 0 0\nmtllib gone.mtl\n")
    (tmp_path / "mats" / "a.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd ../w.png\nnewmtl n\nmap_Kd ../w.png\n"
                                             "norm n.png\n")
    found = [(reference.by.name, reference.key, reference.name, reference.image)
             for reference in references(tmp_path / "a.obj")]
    assert found == [("a.obj", "mtllib", "mats/a.mtl", False), ("a.mtl", "map_Kd", "mats/../w.png", True),
                     ("a.mtl", "norm", "mats/n.png", False), ("a.obj", "mtllib", "gone.mtl", False)]


def test_gltf_encodes_names_and_may_hold_its_data(tmp_path: Path) -> None:
    images = [{"uri": "data:,"}, {"uri": "old%20oak.png"}, {"bufferView": 0}]
    (tmp_path / "a.gltf").write_text(json.dumps({"asset": {"version": "2.0"}, "images": images,
                                                   "buffers": [{"uri": "a.bin"}]}))
    found = [(reference.key, reference.written, reference.name) for reference in references(tmp_path / "a.gltf")]
    assert found == [("buffers[0].uri", "a.bin", "a.bin"), ("images[1].uri", "old%20oak.png", "old oak.png")]
    (tmp_path / "a.gltf").write_text("[]")
    with pytest.raises(ValueError, match="expected it to hold an object"):
        references(tmp_path / "a.gltf")
