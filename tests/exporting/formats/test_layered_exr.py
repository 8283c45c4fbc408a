"""One EXR with all layers: channels by name, pixels bit by bit, and what compositors make of the names."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from dataset_builder.exporting.export_dataset import DatasetExport, export_dataset
from dataset_builder.exporting.formats.layered_exr import channel_names, encode_layers, root_layer
from dataset_builder.layers import LAYERS
from dataset_builder.shards import exr
from dataset_builder.shards.reader import open_dataset
from tests.ecosystem.pages import Truth
from tests.exporting.formats.conftest import Export
from tests.shards.tiny_dataset import build

PYTHON = os.environ.get("BPY_PYTHON") or (sys.executable if importlib.util.find_spec("bpy") else "")
PASSES = """
import sys, bpy
node = bpy.data.node_groups.new("c", "CompositorNodeTree").nodes.new("CompositorNodeImage")
node.image = bpy.data.images.load(sys.argv[1])
print("passes", *(f"{out.name}:{out.type}" for out in node.outputs if out.enabled))
"""


def planes(path: Path) -> dict[str, np.ndarray]:
    file = OpenEXR.File(str(path), separate_channels=True)
    return {name: channel.pixels for name, channel in file.channels().items()}


def test_every_layer_is_there(exported: Export, truth: Truth) -> None:
    folder = exported("exr")
    for key, example in truth.items():
        path = folder / example["meta"]["split"] / f"{key}.exr"
        assert json.loads(path.with_suffix(".json").read_text()) == example["meta"]
        found = planes(path)
        for name, layer in example.items():
            if name != "meta":
                names = ["R", "G", "B"] if name == "i_t" else channel_names(name)
                assert all(found.pop(one).tobytes() == layer[..., k].tobytes() for k, one in enumerate(names))
        assert not found
        header = OpenEXR.File(str(path), header_only=True).header()
        assert (header["3df-lighting:key"], header["3df-lighting:root"]) == (key, "i_t")


def test_halves_stay_halves(tmp_path: Path) -> None:
    build(tmp_path / "half", dtype="float16")
    export_dataset(DatasetExport(dataset=tmp_path / "half", out=tmp_path / "out", kind="exr", splits=["test"],
                                 layers=["mask", "i_s"]))
    found, (key,) = planes(tmp_path / "out" / "test" / "00000003.exr"), open_dataset(tmp_path / "half").splits["test"]
    assert {name: plane.dtype for name, plane in found.items()} == dict.fromkeys(["B", "G", "R", "mask.A"], np.float16)
    assert found["R"].astype(np.float32).tobytes() == open_dataset(tmp_path / "half")[key]["i_s"][..., 0].tobytes()


def test_names_are_those_of_compositors() -> None:
    """Colours R, G, B, directions X, Y, Z, Nuke's own depth; no two layers share a channel, and none takes the root."""
    names = {layer: channel_names(layer) for layer in LAYERS}
    assert names["s_prime"] == ("s_prime.R", "s_prime.G", "s_prime.B")
    assert names["normal_rough"] == ("normal_rough.X", "normal_rough.Y", "normal_rough.Z")
    assert names["depth"] == ("depth.Z",) and names["mask_rough"] == ("mask_rough.A",)
    every = [name for own in names.values() for name in own]
    assert len(set(every)) == len(every) and all(name.count(".") == 1 and len(name) < 64 for name in every)


def test_the_root_is_a_colour() -> None:
    def root(*layers: str) -> str:
        return root_layer(dict.fromkeys(layers))

    assert root("i_s", "d", "i_t") == "i_t" and root("d", "i_s") == "i_s"
    assert root("normal", "mask", "s_prime") == "s_prime" and root("normal", "depth") == ""


def test_numbers_without_colours_are_no_root() -> None:
    image = exr.ExrImage(planes=np.ones((1, 4, 4), np.float32), dtype="float32", layer="depth", key="00000000")
    data = encode_layers({"depth": image}, key="00000000")
    assert b"depth.Z" in data and b"lin_rec709_scene" in data


@pytest.mark.skipif(not PYTHON, reason="no bpy here, and BPY_PYTHON names no environment with it")
def test_blender_shows_them_as_passes(exported: Export) -> None:
    done = subprocess.run([PYTHON, "-c", PASSES, str(exported("exr") / "test" / "00000003.exr")], check=True,
                          capture_output=True, text=True, timeout=120)
    passes = next(line for line in done.stdout.splitlines() if line.startswith("passes ")).split()[1:]
    assert {"Combined:RGBA", "i_s:RGBA", "d:RGBA", "r:RGBA", "s_prime:RGBA", "mask:VALUE"} <= set(passes)
