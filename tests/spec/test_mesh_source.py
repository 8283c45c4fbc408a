"""Which files a mesh file names, in the words of glTF."""

import json
from pathlib import Path

import pytest

from dataset_builder.spec.mesh_source import references


def test_gltf_encodes_names_and_may_hold_its_data(tmp_path: Path) -> None:
    images = [{"uri": "data:,"}, {"uri": "old%20oak.png"}, {"bufferView": 0}]
    (tmp_path / "a.gltf").write_text(json.dumps({"asset": {"version": "2.0"}, "images": images,
                                                   "buffers": [{"uri": "a.bin"}]}))
    found = [(reference.key, reference.written, reference.name) for reference in references(tmp_path / "a.gltf")]
    assert found == [("buffers[0].uri", "a.bin", "a.bin"), ("images[1].uri", "old%20oak.png", "old oak.png")]
    (tmp_path / "a.gltf").write_text("[]")
    with pytest.raises(ValueError, match="expected it to hold an object"):
        references(tmp_path / "a.gltf")


@pytest.mark.parametrize("written", ["../w.png", "/etc/hostname", "link.png", "a/../../w.png"])
def test_no_file_outside_of_the_folder_is_named(tmp_path: Path, written: str) -> None:
    """Its digest would be of a file that the object's folder does not bring along."""
    (folder := tmp_path / "chair").mkdir()
    (tmp_path / "w.png").write_bytes(b"")
    (folder / "link.png").symlink_to("../w.png")
    (folder / "a.gltf").write_text(json.dumps({"asset": {"version": "2.0"}, "images": [{"uri": written}]}))
    rule = r"images\[0\].uri: expected a (file in the folder of the mesh|name relative to the file)"
    with pytest.raises(ValueError, match=rule):
        references(folder / "a.gltf")


def test_a_ply_file_names_textures_in_comments(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(b"ply\r\nformat ascii 1.0\r\ncomment TextureFile sub\\old oak.png\r\ncomment made by hand\r\n"
                     b"comment texturefile b.png\r\nelement vertex 0\r\nend_header\r\n")
    found = [(reference.key, reference.written, reference.image) for reference in references(path)]
    assert found == [("line 3: TextureFile", "sub/old oak.png", True), ("line 5: TextureFile", "b.png", True)]


@pytest.mark.parametrize(("header", "error"), [
    ("plx\nend_header\n", "line `ply`"), ("ply\nformat ascii 1.0\n", "line `end_header`"),
    ("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "line 3"),
    ("ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n", "line 4"),
    ("ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\nend_header\n", "line 4"),
    ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "line 3"),
    ("ply\nelement vertex 1\nend_header\n", "line `format`"),
    ("ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int x\nend_header\n", "one property"),
])
def test_a_ply_header_that_breaks_the_format(tmp_path: Path, header: str, error: str) -> None:
    (tmp_path / "a.ply").write_text(header)
    with pytest.raises(ValueError, match=error):
        references(tmp_path / "a.ply")
