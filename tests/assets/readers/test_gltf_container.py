"""Containers of glTF: chunks, versions, buffers, and the files that are named."""

import base64
import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.file_model import FileModel
from dataset_builder.assets.readers import gltf
from dataset_builder.errors import UserError
from dataset_builder.spec.mesh_source import companions
from tests.assets.gltf_files import COLORS, QUAD_UVS, GltfMaker, glb, load, png, quad_of

BASE = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def quad() -> GltfMaker:
    made = GltfMaker()
    made.draw(made.primitive())
    return made


def apart(folder: Path, uri: str = "quad.bin", image: str = "wood.png", **header: Any) -> Path:
    """A textured quad as .gltf with files beside it, of these addresses."""
    made = GltfMaker()
    made.add("images", uri=image)
    made.add("textures", source=0)
    made.draw(made.primitive(TEXCOORD_0=QUAD_UVS, material=made.add("materials", **BASE)))
    made.add("buffers", uri=uri, byteLength=len(made.binary))
    (folder / "quad.bin").write_bytes(made.binary)
    (folder / "wood.png").write_bytes(png(COLORS))
    (folder / "a.gltf").write_text(json.dumps(made.finished() | header))
    return folder / "a.gltf"


def read(path: Path) -> FileModel:
    return gltf.read(path, 64)


def test_padding_and_byte_order_marks(tmp_path: Path) -> None:
    made = quad()
    header = b"\xef\xbb\xbf" + json.dumps(made.finished()).encode() + b"  "
    for pad in (b" ", b"\0"):
        (tmp_path / "a.glb").write_bytes(glb(header, made.binary + bytes(8), pad=pad))
        assert len(read(tmp_path / "a.glb").parts) == 1
    path = apart(tmp_path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(read(path).parts) == 1


def test_a_suffix_that_lies(tmp_path: Path) -> None:
    made = quad()
    (tmp_path / "a.gltf").write_bytes(glb(made.finished(), made.binary))
    assert len(read(tmp_path / "a.gltf").parts) == 1


def test_other_chunks_are_named(tmp_path: Path) -> None:
    made = quad()
    data = bytearray(glb(made.finished(), made.binary) + struct.pack("<I4s", 4, b"ACME") + bytes(4))
    data[8:12] = struct.pack("<I", len(data))
    (tmp_path / "a.glb").write_bytes(data)
    assert read(tmp_path / "a.glb").left_out == ("a chunk b'ACME' of 4 bytes", "1 primitive without a material")


@pytest.mark.parametrize(("change", "rule"), [
    (lambda data: data[:100], "100 of the .* bytes that it says it has; it is cut short"),
    (lambda data: data[:12] + b"\xff\xff\xff\x7f" + data[16:], r"a chunk b'JSON' of 2,147,483,647 bytes where only"),
    (lambda data: data[:16] + b"BIN\0" + data[20:], "expected one JSON chunk, then at most one BIN chunk"),
    (lambda data: data[:4] + struct.pack("<I", 1) + data[8:],
     "glTF 1.0, which is not read: convert the file to glTF 2.0"),
    (lambda data: data[:4] + struct.pack("<I", 3) + data[8:], "version 3 of the binary format, expected 2"),
    (lambda data: data[:10], "expected at least 20 bytes, got 10"),
    (lambda data: b"", "expected it to start with glTF"),
    (lambda data: glb(b"[]", None), "expected it to hold an object"), (lambda data: glb(b"{", None), "Expecting"),
    (lambda data: glb(b'{"asset": {"version": "2.0"}, "x": NaN}', None), "expected numbers, got NaN"),
    (lambda data: glb(b'"\xff"', None), "can't decode"), (lambda data: glb(b"[" * 99999, None), "nested without end")])
def test_files_that_are_damaged_or_old(tmp_path: Path, change: Any, rule: str) -> None:
    made = quad()
    (tmp_path / "a.glb").write_bytes(change(glb(made.finished(), made.binary)))
    with pytest.raises(UserError, match=rf"a\.glb: expected a readable .glb file, got: .*{rule}"):
        load(tmp_path / "a.glb")
    with pytest.raises(UserError, match=rule):
        read(tmp_path / "a.glb")


@pytest.mark.parametrize(("asset", "rule"), [
    ({"version": "1.1"}, "glTF 1.1, which is not read: convert"), ({"version": 2.0}, "a version of 2.0"),
    ({"version": "2.5", "minVersion": "2.1"}, "asks for version '2.1' at least"), (None, "JSON without an asset")])
def test_versions(tmp_path: Path, asset: Any, rule: str) -> None:
    with pytest.raises(UserError, match=rule):
        read(apart(tmp_path, asset=asset))
    assert len(read(apart(tmp_path, asset={"version": "2.5"})).parts) == 1


def test_gltf_1_names_its_entries(tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(json.dumps({"buffers": {"b": {"uri": "x.bin"}}, "meshes": {}}))
    with pytest.raises(UserError, match=r"glTF 1\.0, which is not read: convert the file to glTF 2\.0"):
        load(tmp_path / "a.gltf")


@pytest.mark.parametrize("scheme", ["data:application/octet-stream;base64,", "data:;base64,", "DATA:,"])
def test_data_uris(tmp_path: Path, scheme: str) -> None:
    made = quad()
    packed, escaped = base64.b64encode(made.binary).decode().rstrip("="), "".join(f"%{b:02x}" for b in made.binary)
    text = packed if "base64" in scheme else escaped
    made.add("buffers", uri=scheme + text, byteLength=len(made.binary))
    (tmp_path / "a.gltf").write_text(json.dumps(made.finished()))
    assert len(read(tmp_path / "a.gltf").parts) == 1 and companions(tmp_path / "a.gltf") == ()


@pytest.mark.parametrize(("uri", "rule"), [
    ("data:;base64,AAAA", r"buffers\[0\]: expected 60 bytes, got 3 .the file that holds it is cut short"),
    ("data:;base64,A A!", r"buffers\[0\].uri: expected base64"), ("data:nothing", "expected data after a comma"),
    (7, r"buffers\[0\].uri: expected text, got 7"), (None, r"buffers\[0\].uri: expected text, got nothing")])
def test_data_that_is_not_there(tmp_path: Path, uri: Any, rule: str) -> None:
    made = quad()
    made.add("buffers", uri=uri, byteLength=len(made.binary))
    (tmp_path / "a.gltf").write_text(json.dumps(made.finished()))
    with pytest.raises(UserError, match=rule):
        read(tmp_path / "a.gltf")


def test_buffers_are_as_long_as_they_say(tmp_path: Path) -> None:
    path = apart(tmp_path)
    (tmp_path / "quad.bin").write_bytes(bytes(20))
    with pytest.raises(UserError, match=r"buffers\[0\]: expected 92 bytes, got 20"):
        read(path)
    made = quad()
    (tmp_path / "a.glb").write_bytes(glb(made.finished(), None))
    with pytest.raises(UserError, match=r"buffers\[0\]: expected a uri, or a .glb file with a binary chunk"):
        read(tmp_path / "a.glb")


@pytest.mark.parametrize(("written", "name"), [
    ("old%20oak.png", "old oak.png"), ("old oak.png", "old oak.png"), ("st%C3%BChle.png", "stühle.png"),
    ("stühle.png", "stühle.png"), ("50%.png", "50%.png"), ("a%20b.png", "a%20b.png"), (".\\sub\\w.png", "sub/w.png"),
    ("sub/../w.png", "w.png")])
def test_names_with_spaces_escapes_and_letters_of_all_kinds(tmp_path: Path, written: str, name: str) -> None:
    path = apart(tmp_path, image=written)
    (tmp_path / "sub").mkdir()
    (tmp_path / "wood.png").rename(tmp_path / name)
    assert len(read(path).materials) == 1
    assert {(tmp_path / each).resolve() for each in companions(path)} == {tmp_path / name, tmp_path / "quad.bin"}


@pytest.mark.parametrize(("uri", "rule"), [
    ("../secret.bin", r"buffers\[0\].uri: expected a file in the folder of the mesh or below it, got '../secret.bin'"),
    ("sub/../../secret.bin", "below it"), ("%2e%2e/secret.bin", "below it"), ("link.bin", "below it, got 'link.bin'"),
    ("/etc/passwd", "expected a name relative to the file, got '/etc/passwd'"),
    ("\\\\host\\x.bin", "relative to the file"),
    ("http://example.org/x.bin", "nothing is fetched from elsewhere"), ("file:///etc/passwd", "relative to the file"),
    ("C:\\x.bin", "relative to the file"), ("a\0b", "null"), ("x" * 5000, "expected"),
    ("Quad.BIN", "Quad.BIN.*quad.bin is there: write its name as it is")])
def test_files_elsewhere_are_never_opened(tmp_path: Path, uri: str, rule: str) -> None:
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(bytes(200))
    os.symlink(tmp_path / "secret.bin", folder / "link.bin")
    path = apart(folder, uri=uri)
    for how in (read, load):
        with pytest.raises(UserError, match=rule):
            how(path)


def test_links_that_stay_inside_are_followed(tmp_path: Path) -> None:
    path = apart(tmp_path, uri="link.bin")
    os.symlink("quad.bin", tmp_path / "link.bin")
    assert len(read(path).parts) == 1


def test_the_inventory_tells_what_was_taken_of_what_there_is(tmp_path: Path) -> None:
    made = quad_of({"name": "m", "doubleSided": True, **BASE}, [COLORS])
    made.draw(made.primitive(), made.primitive(faces=np.array([0, 1, 2, 3], np.uint8), mode=5, material=0))
    made.add("meshes", primitives=[made.primitive()])
    made.add("materials", name="unused")
    model = made.model(tmp_path)
    assert model.contains == "2 meshes, 3 primitives, 6 triangles of 8, 1 material, 1 image"
    assert model.left_out[-1] == "1 primitive without a material"
    assert [part.name for part in model.parts] == [
        "nodes[0], meshes[0].primitives[0]", "nodes[1], meshes[1].primitives[0]", "nodes[1], meshes[1].primitives[1]"]
