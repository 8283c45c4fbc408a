"""Damaged glTF files end in clear errors, in little memory, and without a look at files elsewhere."""

import copy
import json
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.assets.file_model import FileModel
from dataset_builder.assets.readers import gltf
from dataset_builder.errors import UserError
from tests.assets.gltf_files import COLORS, QUAD, QUAD_UVS, GltfMaker, glb
from tests.assets.readers.test_gltf_nodes import skinned
from tests.assets.readers.test_gltf_packed import RED_BLUE, draco_quad, meshopt_quad

SETTINGS = settings(max_examples=150, deadline=None, derandomize=True, database=None,
                    suppress_health_check=[HealthCheck.function_scoped_fixture])
MOST_BYTES = 2**26
"""That reading a file of some kilobytes may take."""
ODD = st.sampled_from([None, True, -1, 0, 1, 2, 3, 2**31, 2**64, 10**400, 0.5, -1e30, 1e308, "", "x", "../secret.bin",
                       "http://localhost/x", "data:;base64,AAAA", [], {}, [0], [1e30] * 4, {"index": 0},
                       {"extensions": {}}])
WATCHED: list[list[str]] = []
"""Lists that take the name of every file that is opened while they are in here."""


def note_opened(event: str, arguments: tuple[Any, ...]) -> None:
    for opened in WATCHED:
        if event == "open" and isinstance(arguments[0], str | bytes):
            opened.append(str(arguments[0]))


sys.addaudithook(note_opened)


def rich() -> GltfMaker:
    """A file with a little of everything."""
    made = skinned(np.array([[0.5, 0.5, 0, 0]] * 4, np.float32))
    for image in (COLORS, RED_BLUE):
        made.texture(image, sampler={"wrapS": 33071, "magFilter": 9728})
    transform = {"offset": [0.5, 0], "rotation": 1, "scale": [2, 2], "texCoord": 0}
    info = {"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": transform}}
    extensions = {"KHR_materials_" + name: {factor: 0.5, texture: info} for name, factor, texture in (
        ("transmission", "transmissionFactor", "transmissionTexture"),
        ("volume", "thicknessFactor", "thicknessTexture"),
        ("clearcoat", "clearcoatFactor", "clearcoatTexture"), ("specular", "specularFactor", "specularTexture"))}
    material = made.add("materials", name="m", alphaMode="MASK", alphaCutoff=0.5, doubleSided=True,
                        pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 1], "baseColorTexture": info},
                        normalTexture={**info, "scale": 2}, emissiveFactor=[1, 1, 1], emissiveTexture={"index": 1},
                        extensions=extensions | {"KHR_materials_ior": {"ior": 1.5}})
    glossy = {"diffuseFactor": [1, 1, 1, 1], "diffuseTexture": info, "specularFactor": [1, 1, 1], "glossinessFactor": 1}
    made.add("materials", extensions={"KHR_materials_pbrSpecularGlossiness": glossy, "KHR_materials_unlit": {}})
    sparse = {"count": 1, "indices": {"bufferView": made.view(b"\1"), "componentType": 5121},
              "values": {"bufferView": made.view(bytes(12))}}
    made.draw(made.primitive(made.accessor(QUAD, sparse=sparse), TEXCOORD_0=QUAD_UVS, material=material, mode=5,
                             COLOR_0=made.accessor(np.full((4, 4), 9, np.uint8), normalized=True),
                             targets=[{"POSITION": made.accessor(QUAD)}]), made.primitive(material=1, mode=0),
              mesh={"weights": [0.5]}, matrix=np.eye(4).ravel().tolist())
    instances = {"attributes": {"TRANSLATION": made.accessor(QUAD)}}
    made.draw(draco_quad(made, 3, material=1), extensions={"EXT_mesh_gpu_instancing": instances})
    made.use("KHR_draco_mesh_compression", "EXT_mesh_gpu_instancing", required=True)
    return made


SEEDS = [(made.finished(), made.binary) for made in (rich(), meshopt_quad())]


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every value in JSON."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(place for key, item in items for place in places(item, (*path, key)))][not path:]


def check(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    opened: list[str] = []
    WATCHED.append(opened)
    tracemalloc.start()
    try:
        assert isinstance(gltf.read(path, 64), FileModel)
    except UserError as error:
        assert str(error).startswith((str(path), "expected the package"))
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        WATCHED.clear()
    assert peak < MOST_BYTES
    # Modules are imported at their first use
    assert not [name for name in opened if not name.startswith((str(path.parent), sys.prefix, sys.base_prefix))]


def test_the_seeds_are_whole(tmp_path: Path) -> None:
    counts = []
    for header, binary in SEEDS:
        (tmp_path / "a.glb").write_bytes(glb(header, binary))
        counts.append(len(gltf.read(tmp_path / "a.glb", 64).parts))
    assert counts == [6, 1]


@SETTINGS
@given(data=st.binary(max_size=200), head=st.sampled_from([b"", b"glTF", b"glTF\2\0\0\0", b"{", b'{"asset": ']))
@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_any_bytes(tmp_path: Path, suffix: str, data: bytes, head: bytes) -> None:
    check(tmp_path / f"a{suffix}", head + data)


def changed(document: dict[str, Any], chosen: st.DataObject) -> dict[str, Any]:
    """A copy with up to three values replaced by odd ones, or taken away."""
    header = copy.deepcopy(document)
    for _ in range(chosen.draw(st.integers(1, 3))):
        *way, last = chosen.draw(st.sampled_from(places(header)))
        holder = header
        for key in way:
            holder = holder[key]
        if chosen.draw(st.booleans()):
            holder[last] = chosen.draw(ODD)
        else:
            del holder[last]
    return header


@SETTINGS
@given(chosen=st.data())
@pytest.mark.parametrize("seed", SEEDS, ids=["rich", "meshopt"])
def test_any_change_of_the_json(tmp_path: Path, seed: tuple[dict[str, Any], bytes], chosen: st.DataObject) -> None:
    header = changed(seed[0], chosen)
    check(tmp_path / "a.glb", glb(json.dumps(header).encode(), seed[1]))


@SETTINGS
@given(changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=20))
@pytest.mark.parametrize("seed", SEEDS, ids=["rich", "meshopt"])
def test_any_change_of_the_numbers(tmp_path: Path, seed: tuple[dict[str, Any], bytes],
                                   changes: list[tuple[int, int]]) -> None:
    binary = bytearray(seed[1])
    for place, value in changes:
        binary[place % len(binary)] = value
    check(tmp_path / "a.glb", glb(seed[0], bytes(binary)))


@SETTINGS
@given(length=st.integers(0, 10**6))
def test_files_that_are_cut_short(tmp_path: Path, length: int) -> None:
    whole = glb(*SEEDS[0])
    (tmp_path / "a.glb").write_bytes(whole[:length % len(whole)])
    with pytest.raises(UserError):
        gltf.read(tmp_path / "a.glb", 64)
