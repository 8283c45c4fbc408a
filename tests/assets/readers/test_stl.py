"""STL files give their triangles, or say how many there should be."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers.stl import read
from dataset_builder.errors import UserError

TETRA = np.array([(0, 0, 0), (3, 0, 0), (0, 3, 0), (0, 0, 3)], dtype=np.float32)[
    [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]]
"""Volume 4.5."""


def binary(corners=TETRA, *, header=b"", attribute=0, count=None):
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *each.reshape(-1), attribute) for each in corners)
    return header.ljust(80, b"\0") + struct.pack("<I", len(corners) if count is None else count) + records


def text(corners=TETRA, name="a thing"):
    facets = "".join("  facet normal 0 0 0\n    outer loop\n" + "".join(
        f"      vertex {x:.6e} {y:g} {z:g}\n" for x, y, z in each) + "    endloop\n  endfacet\n" for each in corners)
    return f"solid {name}\n{facets}endsolid {name}\n".encode()


def write(folder, content):
    (folder / "a.stl").write_bytes(content)
    return folder / "a.stl"


def error_of(path):
    with pytest.raises(UserError) as caught:
        read(path, 64)
    return str(caught.value)


@pytest.mark.parametrize("content", [
    binary(), text(), binary(header=b"solid but binary"), text().replace(b"\n", b"\r\n"), text().upper(), text()[:-1],
    text(name=""), text(TETRA[:3]) + text(TETRA[3:])])
def test_loose_triangles_become_a_closed_surface(tmp_path, content):
    asset = load_mesh_file(write(tmp_path, content), name="a", category="b", licence="CC0-1.0", scale=0.001, up="z")
    assert len(asset.mesh.positions) == 4
    assert asset.mesh.volume == pytest.approx(4.5e-9)
    assert "without units" in asset.meta["left_out"]


def test_solids_are_parts_by_their_names(tmp_path):
    model = read(write(tmp_path, text(TETRA[:3], "first half") + b"\n" + text(TETRA[3:], "second")), 64)
    assert [(part.name, len(part.faces)) for part in model.parts] == [("first half", 3), ("second", 1)]
    assert model.contains == "2 solids, 4 triangles"


def test_colours_are_named(tmp_path):
    model = read(write(tmp_path, binary(attribute=0x8001, header=b"COLOR=abcd")), 64)
    assert model.left_out[:2] == ("attributes of 4 triangles, which are colours in some programs",
                                  "color in the header")


@pytest.mark.parametrize(("content", "error"), [
    (binary()[:-50], "expected 284 bytes, which hold the 4 triangles"),
    (binary(count=2**32 - 1), "4294967295 triangles"),
    (binary() + b"more", "got 288"), (binary(TETRA[:0]), "expected triangles, got none"), (b"", "got 0"),
    (text(TETRA[:0]), "expected triangles, got none"), (text()[:-60], "line 23: expected a whole facet"),
    (text()[:-60], "after 3 triangles"), (text().replace(b"endsolid a thing\n", b""), "got the end of the file"),
    (text().replace(b"      vertex 3.000000e+00 0 0\n", b"", 1), "after 0 triangles"),
    (text().replace(b"3.000000e+00 0 0", b"3 x 0", 1), "expected three numbers of a vertex, got '3 x 0'"),
    (text().replace(b"3.000000e+00 0 0", b"nan 0 0", 1), "a thing: expected finite vertices, got 1"),
    (binary()[:96] + b"\x01\x00\x80\x7f" + binary()[100:], "solid: expected finite vertices, got 1"),
    (text() + b"rubbish", "line 31: expected solid, got 'rubbish'"),
])
def test_what_is_not_whole_is_refused_with_figures(tmp_path, content, error):
    assert error in error_of(write(tmp_path, content))


@settings(max_examples=200, derandomize=True, deadline=None)
@given(start=st.sampled_from([binary(), text()]), at=st.integers(0, 700), gone=st.integers(0, 60),
       put=st.binary(max_size=9))
def test_no_bytes_raise_anything_but_a_user_error(tmp_path_factory, start, at, gone, put):
    path = write(tmp_path_factory.getbasetemp(), start[:at] + put + start[at + gone:])
    try:
        model = read(path, 16)
    except UserError:
        return
    assert all(np.isfinite(part.positions).all() for part in model.parts)
