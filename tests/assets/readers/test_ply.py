"""PLY files of every kind give their surface, their colours and their textures, or say what is wrong."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from dataset_builder.assets.linear_texels import linear_from_srgb
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers.ply import read
from dataset_builder.errors import UserError
from dataset_builder.spec.mesh_source import companions, mesh_source
from dataset_builder.spec.ply_references import TYPES

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
NOTCH = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0)]
"""A pentagon with a corner that turns inwards: area 2.5."""
XYZ = ("float x", "float y", "float z")
FACE = ("list uchar int vertex_indices",)
FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")


def ply(kind, elements, *, comments=(), ending="\n", **changed):
    """A file of (name, properties, rows); a row is a flat list, with each list as a list in it."""
    lines = ["ply", f"format {kind} 1.0", *(f"comment {comment}" for comment in comments)]
    body = b""
    for name, properties, rows in elements:
        lines += [f"element {name} {changed.get(name, len(rows))}", *(f"property {each}" for each in properties)]
        for row in rows:
            body += encoded(kind, properties, row)
    return ending.join([*lines, "end_header", ""]).encode() + body


def encoded(kind, properties, row):
    if kind == "ascii":
        flat = [word for each in row for word in ([len(each), *each] if isinstance(each, list) else [each])]
        return (" ".join(map(str, flat)) + "\n").encode()
    order, made = "<" if "little" in kind else ">", b""
    for each, value in zip(properties, row, strict=True):
        types = [order + TYPES[word] for word in each.split()[:-1] if word != "list"]
        values = value if isinstance(value, list) else [value]
        if isinstance(value, list):
            made += np.array(len(values), types[0]).tobytes()
        made += np.array(values, types[-1]).tobytes()
    return made


def write(folder, *how, **what):
    path = folder / "a.ply"
    path.write_bytes(ply(*how, **what))
    return path


def vertices(points=SQUARE, properties=XYZ, *more):
    return "vertex", properties, [[*point, *(column[index] for column in more)] for index, point in enumerate(points)]


def faces(*corners):
    return "face", FACE, [[list(each)] for each in corners]


def area(part):
    a, b, c = np.moveaxis(part.positions[part.faces], 1, 0)
    return np.cross(b - a, c - a)[:, 2].sum() / 2


def error_of(path):
    with pytest.raises(UserError) as caught:
        read(path, 64)
    return str(caught.value)


@pytest.mark.parametrize("kind", FORMATS)
def test_triangles_quads_and_concave_polygons_in_one_file(tmp_path, kind):
    points = [*SQUARE, *((x + 3, y, z) for x, y, z in NOTCH)]
    model = read(write(tmp_path, kind, [vertices(points), faces((0, 1, 2, 3), (4, 5, 6, 7, 8), (0, 1, 2))]), 64)
    (part,) = model.parts
    assert len(part.faces) == 2 + 3 + 1
    assert area(part) == pytest.approx(1 + 2.5 + 0.5)
    assert model.contains == "9 vertices, 3 faces, 6 triangles"
    assert model.left_out == ()


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", sorted(TYPES))
def test_every_type_by_its_old_and_new_name(tmp_path, kind, name):
    """As a coordinate, as the length of a list and as its values."""
    integer = name if TYPES[name][0] in "iu" else "int"
    lists = f"list {integer} {integer} vertex_index"
    body = [vertices(SQUARE, (f"{name} x", "double y", f"{name} z")), ("face", (lists,), [[[0, 1, 2]], [[0, 1, 2, 3]]])]
    (part,) = read(write(tmp_path, kind, body), 64).parts
    np.testing.assert_array_equal(part.positions, SQUARE)
    assert area(part) == 1.5


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_other_elements_and_properties_are_passed_over_and_named(tmp_path, kind, ending):
    edges = ("edge", ("int vertex1", "list uchar short tags", "uchar flag"), [[0, [1, 2], 3], [1, [], 4]])
    mixed = ("face", ("uchar flags", "list uchar float weights", "short group", *FACE, "double quality"),
             [[7, [0.5], 1, [0, 1, 2, 3], 2.0], [7, [], 2, [0, 1, 2], 3.0], [7, [0.5, 0.25], 3, [0, 2, 3], 4.0]])
    body = [edges, vertices(SQUARE, (*XYZ, "float nx", "float ny", "float nz", "float confidence"), *[[1.0] * 4] * 4),
            ("camera", ("float view_px",), [[1.0]]), mixed]
    model = read(write(tmp_path, kind, body, ending=ending), 64)
    assert area(model.parts[0]) == 2
    assert model.left_out == ("element edge", "vertex properties confidence", "element camera",
                              "face properties flags, weights, group, quality")


@pytest.mark.parametrize("kind", FORMATS)
def test_strips_turn_every_second_triangle_round(tmp_path, kind):
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 2, 0), (1, 2, 0)]
    strips = ("tristrips", ("list int int vertex_indices",), [[[0, 1, 2, 3, -1, 2, 3, 4, 5, -1, 0, 1]]])
    (part,) = read(write(tmp_path, kind, [vertices(points), strips]), 64).parts
    np.testing.assert_array_equal(part.faces, [(0, 1, 2), (2, 1, 3), (2, 3, 4), (4, 3, 5)])
    assert area(part) == 2


@pytest.mark.parametrize("names", [("red", "green", "blue", "alpha"), ("r", "g", "b", "a"),
                                   ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha")])
@pytest.mark.parametrize(("kind", "most"), [("uchar", 255), ("ushort", 65535), ("float", 1.0)])
def test_colours_of_vertices_are_srgb_and_alpha_is_not(tmp_path, names, kind, most):
    shares = np.array([(1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (0.2, 0.4, 0.6, 0.8)])
    columns = (shares * most).round(0 if most > 1 else 9).astype(type(most)).T.tolist()
    body = [vertices(SQUARE, (*XYZ, *(f"{kind} {name}" for name in names)), *columns), faces((0, 1, 3))]
    model = read(write(tmp_path, "binary_little_endian", body), 64)
    expected = np.concatenate([linear_from_srgb(shares[:, :3]), shares[:, 3:]], axis=1)
    np.testing.assert_allclose(model.parts[0].colors, [expected[[0, 1, 3]]], atol=2e-5)
    assert model.parts[0].material == -1
    assert model.left_out == ("colours taken as sRGB",)


@pytest.mark.parametrize(("values", "share", "doubt"), [
    ((1.02, 0.5, 0.0), 1.0, "4 values of vertex colours beyond 0 to 1, clipped"),
    ((51.0, 255.0, 0.0), 0.2, "vertex colours above 1 read as counted up to 255"),
    ((25.5, 0.0, 0.0), 0.1, "vertex colours above 1 read as counted up to 255")])
def test_decimal_colours_above_1_are_shares_unless_they_count_to_255(tmp_path, values, share, doubt):
    columns = [[value] * 4 for value in values]
    body = [vertices(SQUARE, (*XYZ, "float red", "float green", "float blue"), *columns), faces((0, 1, 3))]
    model = read(write(tmp_path, "ascii", body), 64)
    np.testing.assert_allclose(model.parts[0].colors[..., 0], linear_from_srgb(share), rtol=1e-5)
    assert model.left_out == ("colours taken as sRGB", doubt)


def test_colours_of_faces_reach_all_of_their_corners(tmp_path):
    table = ("face", (*FACE, "uchar red", "uchar green", "uchar blue"),
             [[[0, 1, 2, 3], 255, 0, 0], [[0, 1, 2], 0, 0, 255]])
    colors = read(write(tmp_path, "ascii", [vertices(), table]), 64).parts[0].colors
    np.testing.assert_array_equal(colors[:, :, :3], np.repeat([[(1, 0, 0)] * 3, [(0, 0, 1)] * 3], (2, 1), axis=0))
    assert (colors[..., 3] == 1).all()


def write_images(folder, **texels):
    for name, color in texels.items():
        Image.new("RGBA" if len(color) == 4 else "RGB", (2, 2), color).save(folder / f"{name}.png")


@pytest.mark.parametrize("names", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_a_texture_is_the_albedo(tmp_path, names):
    write_images(tmp_path, t=(200, 200, 200, 51))
    uvs = [(0, 0), (0.5, 0), (0.5, 1), (0, 1)]
    body = [vertices(SQUARE, (*XYZ, *(f"float {name}" for name in names)), *np.transpose(uvs)), faces((0, 1, 2))]
    asset = load_mesh_file(write(tmp_path, "ascii", body, comments=["TextureFile t.png"]), name="a", category="b",
                           licence="CC0-1.0")
    material = asset.materials[0]
    albedo = material.texture.base_color * material.base_color
    np.testing.assert_allclose(albedo, linear_from_srgb(200 / 255), rtol=1e-6)
    np.testing.assert_allclose(material.texture.alpha, 0.2)
    np.testing.assert_array_equal(asset.mesh.uvs, [uvs[:3]])


@pytest.mark.parametrize("kind", FORMATS)
def test_wedge_coordinates_and_several_textures(tmp_path, kind):
    """As MeshLab writes them; a face without a texture keeps the colours of its vertices."""
    write_images(tmp_path, a=(255, 0, 0), b=(0, 0, 255))
    table = ("face", (*FACE, "list uchar float texcoord", "int texnumber"),
             [[[0, 1, 2], [0.0, 0.0, 0.25, 0.0, 0.25, 0.5], 1], [[0, 1, 2, 3], [0.0] * 4 + [1.0] * 4, 0],
              [[1, 2, 3], [], -1]])
    red = [255, 0, 0, 0]
    body = [vertices(SQUARE, (*XYZ, "uchar red", "uchar green", "uchar blue"), red, red, red), table]
    model = read(write(tmp_path, kind, body, comments=[f"TextureFile {name}.png" for name in "abc"]), 64)
    assert [each.material.name for each in model.materials] == ["a.png", "b.png"]
    assert [(part.material, len(part.faces), part.colors is None) for part in model.parts] == [
        (-1, 1, False), (0, 2, True), (1, 1, True)]
    np.testing.assert_array_equal(model.parts[2].uvs[0], [[(0, 0), (0.25, 0), (0.25, 0.5)]])
    assert model.left_out[:2] == ("colours under a texture", "texture c.png, which no face uses")


def test_textures_belong_to_the_digest(tmp_path):
    write_images(tmp_path, t=(255, 0, 0))
    body = [vertices(SQUARE, (*XYZ, "float s", "float t"), *[[0.0] * 4] * 2), faces((0, 1, 2))]
    path = write(tmp_path, "ascii", body, comments=["TextureFile t.png"])
    before = mesh_source(path, companions(path)).digest
    write_images(tmp_path, t=(0, 0, 255))
    assert mesh_source(path, companions(path)).digest != before
    (tmp_path / "t.png").unlink()
    with pytest.raises(UserError, match=r"a.ply: line 3: TextureFile: expected an existing file, got t.png"):
        load_mesh_file(path, name="a", category="b", licence="CC0-1.0")


@pytest.mark.parametrize(("kind", "cut", "got"), [("ascii", 8, 5), ("binary_little_endian", 1, 5), ("ascii", 48, 0)])
def test_a_file_that_is_cut_short_is_refused_with_figures(tmp_path, kind, cut, got):
    path = write(tmp_path, kind, [vertices(), faces(*[(0, 1, 2)] * 6)])
    path.write_bytes(path.read_bytes()[:-cut])
    assert f"expected 6 faces, as the header declares, got {got}" in error_of(path)


@pytest.mark.parametrize(("how", "error"), [
    ({"kind": "ascii", "face": 12}, "expected 12 faces, as the header declares, got 2"),
    ({"kind": "binary_big_endian", "face": 12}, "expected 12 faces, as the header declares, got 2"),
    ({"kind": "binary_little_endian", "vertex": 2**31}, "expected 2147483648 vertices, as the header declares, got 6"),
    ({"kind": "ascii", "vertex": 2**31}, "expected 2147483648 vertices, as the header declares, got 7"),
    ({"kind": "binary_little_endian", "face": 1}, "expected 65 bytes of data, as the header declares, got 78"),
    ({"kind": "ascii", "face": 1}, "expected 17 numbers of data, as the header declares, got 21"),
])
def test_counts_of_the_header_are_held_to(tmp_path, how, error):
    assert error in error_of(write(tmp_path, how.pop("kind"), [vertices(), faces((0, 1, 2, 3), (0, 1, 2))], **how))


@pytest.mark.parametrize(("body", "error"), [
    ([vertices(), faces((0, 1, 2), (0, 1, 4), (0, 9, 9))],
     "in [0, 4), got 2 faces with others, first at face 1, which has 4"),
    ([vertices(), faces((0, 1, -2))], "got 1 faces with others, first at face 0, which has -2"),
    ([vertices(), faces((0, 1, 2), (0, 1))], "3 or more corners, got 1 with fewer, first at face 1, which has 2"),
    ([vertices([(0, 0, 0), (np.nan, 0, 0), (0, np.inf, 0)]), faces((0, 1, 2))],
     "got 2 with NaN or Inf, first at vertex 1"),
    ([vertices([(0, 0, 0), (1, 0, 0), (0, 2e30, 0)]), faces((0, 1, 2))],
     "within 1e+30, got 1 beyond, first at vertex 2"),
    ([vertices()], "a cloud of 4 points"),
    ([vertices(), faces()], "a cloud of 4 points"),
    ([vertices(SQUARE, (*XYZ, "float f_dc_0", "float scale_0", "float rot_0"), *[[0.0] * 4] * 3)], "4 Gaussian splats"),
    ([("vertex", XYZ[:2], [[0, 0]]), faces((0, 0, 0))], "an element vertex with x, y and z, got x, y"),
    ([vertices(), ("face", (*FACE, "list uchar float texcoord"), [[[0, 1, 2], [0.0, 1.0]]])],
     "which has 2 for 3 corners"),
    ([vertices(), ("face", ("list uchar float vertex_index",), [[[0.0, 1.0, 2.0]]])], "a list of integers"),
])
@pytest.mark.parametrize("kind", FORMATS)
def test_what_makes_no_surface_is_refused(tmp_path, kind, body, error):
    assert error in error_of(write(tmp_path, kind, body))


@pytest.mark.parametrize(("change", "error"), [
    ((b"0 1 0\n", b"0 one 0\n"), "line 13: expected numbers, got '0 one 0'"),
    ((b"3 0 1 2\n", b"3 0 1.5 2\n"), "expected whole numbers"),
    ((b"3 0 1 2\n", b"-3 0 1 2\n"), "length is negative"),
])
def test_text_that_is_no_number_is_refused(tmp_path, change, error):
    path = write(tmp_path, "ascii", [vertices(), faces((0, 1, 2))])
    path.write_bytes(path.read_bytes().replace(*change))
    assert error in error_of(path)


WHOLE = [ply(kind, [("edge", ("list char short n",), [[[1]], [[]]]), vertices(SQUARE, (*XYZ, "uchar red", "float s"),
                                                                          [1] * 4, [1.0] * 4),
                    ("face", (*FACE, "list uint float texcoord"), [[[0, 1, 2], []], [[0, 1, 2, 3], []]])])
         for kind in FORMATS]


@settings(max_examples=300, derandomize=True, deadline=None)
@given(start=st.sampled_from([b"", b"ply\n", *WHOLE]), data=st.data())
def test_no_bytes_raise_anything_but_a_user_error(tmp_path_factory, start, data):
    path = tmp_path_factory.getbasetemp() / "fuzz.ply"
    path.write_bytes(mutated(start, data))
    try:
        model = read(path, 16)
    except UserError:
        return
    assert all(len(part.faces) for part in model.parts)


def mutated(start: bytes, data) -> bytes:
    """Bytes with a few of them replaced, left out or put in."""
    made = bytearray(start)
    for _ in range(data.draw(st.integers(0, 4))):
        at, end = sorted(data.draw(st.tuples(*[st.integers(0, len(made))] * 2)))
        made[at:min(end, at + data.draw(st.integers(0, 8)))] = data.draw(st.binary(max_size=8))
    return bytes(made) or data.draw(st.binary(max_size=400))


def test_the_fuzzed_files_are_good_ones(tmp_path: Path) -> None:
    for number, content in enumerate(WHOLE):
        (tmp_path / f"{number}.ply").write_bytes(content)
        assert area(read(tmp_path / f"{number}.ply", 16).parts[0]) == 1.5
