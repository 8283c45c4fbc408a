"""OFF files give their polygons and colours, or say what is wrong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dataset_builder.assets.file_model import GREY
from dataset_builder.assets.linear_texels import linear_from_srgb
from dataset_builder.assets.readers.off import read
from dataset_builder.errors import UserError

NOTCH = "0 0 0\n2 0 0\n2 2 0\n1 0.5 0\n0 2 0\n"
"""A pentagon with a corner that turns inwards: area 2.5."""
PENTAGON = "5 0 1 2 3 4\n"


def write(folder, content):
    (folder / "a.off").write_bytes(content.encode() if isinstance(content, str) else content)
    return folder / "a.off"


def area(part):
    a, b, c = np.moveaxis(part.positions[part.faces], 1, 0)
    return np.cross(b - a, c - a)[:, 2].sum() / 2


@pytest.mark.parametrize("content", [
    f"OFF\n5 1 0\n{NOTCH}{PENTAGON}", f"OFF 5 1 5\n{NOTCH}{PENTAGON}", f"OFF5 1 5\n{NOTCH}{PENTAGON}",
    f"5 1 0\n{NOTCH}{PENTAGON}", f"# by hand\r\nOFF # text\r\n\r\n5 1 0 # counts\r\n{NOTCH}# faces\n{PENTAGON}",
    "NOFF\n5 1 0\n" + NOTCH.replace("\n", " 0 0 1\n") + PENTAGON, f"OFF\n5 1\n{NOTCH}{PENTAGON}"])
def test_a_concave_polygon_in_every_dialect(tmp_path, content):
    model = read(write(tmp_path, content), 64)
    assert len(model.parts[0].faces) == 3
    assert area(model.parts[0]) == pytest.approx(2.5)
    assert (model.left_out, model.parts[0].colors) == ((), None)


@pytest.mark.parametrize("color", ["51 102 255 204", "0.2 0.4 1.0 0.8"])
def test_colours_of_vertices(tmp_path, color):
    model = read(write(tmp_path, "COFF\n5 1 0\n" + NOTCH.replace("\n", f" {color}\n") + PENTAGON), 64)
    np.testing.assert_allclose(model.parts[0].colors[0, 0, :3], linear_from_srgb(np.array([0.2, 0.4, 1])), rtol=1e-6)
    np.testing.assert_allclose(model.parts[0].colors[..., 3], 0.8)


def test_colours_of_faces(tmp_path):
    model = read(write(tmp_path, f"OFF\n5 3 0\n{NOTCH}3 0 1 3 255 0 0\n3 1 2 3 0.0 0.0 1.0 0.5\n3 0 3 4\n"), 64)
    expected = [(1, 0, 0, 1), (0, 0, 1, 0.5), (GREY, GREY, GREY, 1)]
    np.testing.assert_allclose(model.parts[0].colors[:, 2], expected, atol=1e-6)
    assert model.left_out == ("colours taken as sRGB",)


@pytest.mark.parametrize(("content", "error"), [
    ("", "an empty one"), ("OFF\n5 1 0\n" + NOTCH, "expected 5 vertices and 1 faces, a line each, got 5 and 0"),
    (f"OFF\n{2**31} 1 0\n{NOTCH}", "expected 2147483648 vertices and 1 faces, a line each, got 5 and 0"),
    (f"OFF\n5 1 0\n{NOTCH}{PENTAGON}{PENTAGON}", "got 5 and 2"), (f"OFF\n5 0 0\n{NOTCH}", "a cloud of 5 points"),
    (f"OFF\n5 1 0\n{NOTCH}3 0 1 5\n", "expected indices in [0, 5), got 1 faces"),
    (f"OFF\n5 1 0\n{NOTCH}2 0 1\n", "got 1 with fewer"),
    (f"OFF\n5 1 0\n{NOTCH}4 0 1 2\n", "line 8: expected 4 corners"),
    (f"OFF\n5 1 0\n{NOTCH}3 0 1 2 7\n", "colour map"),
    (f"OFF\n5 1 0\n{NOTCH}three 0 1 2\n", "line 8: expected numbers"),
    (f"OFF\n5 1 0\n{NOTCH}3 0 1 2 300 0 0\n", "expected colours"), (f"4OFF\n5 1 0\n{NOTCH}", "got '4OFF'"),
    (f"OFF BINARY\n5 1 0\n{NOTCH}", "line 1"), ("JPEG\n", "line 1: expected the keyword OFF"),
    (f"OFF\n5 1 0\n{NOTCH.replace('1 0.5 0', '1 0.5')}{PENTAGON}", "line 6: expected 3 numbers"),
    (f"OFF\n5 1 0\n{NOTCH.replace('1 0.5 0', '1 x 0')}{PENTAGON}", "line 6: expected numbers"),
    (f"OFF\n5 1 0\n{NOTCH.replace('1 0.5 0', '1 inf 0')}{PENTAGON}", "first at vertex 3"),
])
def test_what_is_not_whole_is_refused_with_figures(tmp_path, content, error):
    with pytest.raises(UserError) as caught:
        read(write(tmp_path, content), 64)
    assert error in str(caught.value)


WHOLE = f"COFF\n5 2 0\n{NOTCH}".replace(" 0\n", " 0 0.5 0.5 0.5 1\n").encode() + f"{PENTAGON}3 0 1 2 9 9 9\n".encode()


@settings(max_examples=200, derandomize=True, deadline=None)
@given(at=st.integers(0, 150), gone=st.integers(0, 30),
       put=st.one_of(st.binary(max_size=9), st.text("0123 -.\n", max_size=9)))
def test_no_bytes_raise_anything_but_a_user_error(tmp_path_factory, at, gone, put):
    put = put.encode() if isinstance(put, str) else put
    path = write(tmp_path_factory.getbasetemp(), WHOLE[:at] + put + WHOLE[at + gone:])
    try:
        model = read(path, 16)
    except UserError:
        return
    assert all(len(part.faces) for part in model.parts)
