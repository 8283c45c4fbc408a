"""Which files a mesh file names, in the words of glTF."""

import json
from pathlib import Path

import pytest

from dataset_builder.spec.mesh_source import references


def test_gltf_encodes_names_and_may_hold_its_data(tmp_path: Path) -> None:
    images = [{"uri": "data:,"}, {"uri": "old%20oak.png"}, {"bufferView": 0}]
    (tmp_path / "a.gltf").write_text(json.dumps({"images": images, "buffers": [{"uri": "a.bin"}]}))
    found = [(reference.key, reference.written, reference.name) for reference in references(tmp_path / "a.gltf")]
    assert found == [("buffers[0].uri", "a.bin", "a.bin"), ("images[1].uri", "old%20oak.png", "old oak.png")]
    (tmp_path / "a.gltf").write_text("[]")
    with pytest.raises(ValueError, match="expected it to hold an object"):
        references(tmp_path / "a.gltf")
