"""OBJ files: what they say is taken, named or refused."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.assets.file_model import FileModel, FilePart
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers import obj_lines
from dataset_builder.assets.readers.obj import read
from dataset_builder.errors import UserError
from tests.assets.readers.wavefront_files import obj, png

CORNERS = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
ELL = [(0, 0), (1, 0), (1, 0.3), (0.3, 0.3), (0.3, 1), (0, 1)]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def load(path: Path):
    return load_mesh_file(path, name="thing", category="thing", licence="CC0-1.0")


def vertices(points) -> str:
    return "".join(f"v {x} {y} {z}\n" for x, y, z in points)


def faces(rings, shift=1) -> str:
    return "".join("f " + " ".join(str(corner + shift) for corner in ring) + "\n" for ring in rings)


def prism(outline, height):
    """Points and faces of a prism whose ends are polygons."""
    count = len(outline)
    points = [(x, y, z) for z in (0, height) for x, y in outline]
    sides = [(k, (k + 1) % count, count + (k + 1) % count, count + k) for k in range(count)]
    return points, [tuple(range(count))[::-1], tuple(range(count, 2 * count)), *sides]


def corners(part: FilePart) -> np.ndarray:
    return part.positions[part.faces]


def area(model: FileModel) -> float:
    spokes = [corners(part)[:, 1:] - corners(part)[:, :1] for part in model.parts]
    return sum(float(np.linalg.norm(np.cross(each[:, 0], each[:, 1]), axis=1).sum()) / 2 for each in spokes)


# Indices

def test_relative_indices_count_from_their_line(tmp_path):
    """Two boxes with the same faces, each after its own vertices; one is half as high."""
    low = [(x + 3, y / 2, z) for x, y, z in CORNERS]
    text = vertices(CORNERS) + faces(SIDES, -8) + vertices(low) + faces(SIDES, -8)
    model = obj(tmp_path, text)
    np.testing.assert_allclose(np.sort(corners(model.parts[0])[12:, :, 0].ravel())[[0, -1]], [3, 4])
    mesh = load(tmp_path / "a.obj").mesh
    assert len(mesh.faces) == 24 and mesh.volume == pytest.approx(1.5)


def test_relative_indices_of_all_three_kinds(tmp_path):
    text = TRIANGLE + "vt 0 0\nvt 0.5 0\nvt 0 0.25\nvn 0 0 1\nf -3/-3/-1 -2/-2/-1 -1/-1/-1\nv 9 9 9\nvt 9 9\n"
    part = obj(tmp_path, text).parts[0]
    np.testing.assert_array_equal(corners(part)[0], [(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    np.testing.assert_array_equal(part.uvs[0][0], [(0, 0), (0.5, 0), (0, 0.25)])


def test_chunks_make_no_difference(tmp_path, monkeypatch):
    text = "".join(vertices(CORNERS) + "vt 0.5 0.25 # half\n" + f"usemtl m{k}\no o{k // 2}\n" +
                   "".join("f " + " ".join(f"{corner - 8}/-1" for corner in ring) + "\n" for ring in SIDES)
                   for k in range(6))
    whole = obj(tmp_path, text)
    monkeypatch.setattr(obj_lines, "CHUNK_BYTES", 37)
    pieces = obj(tmp_path, text)
    assert len(whole.parts) == len(pieces.parts) == 6 and whole.contains == pieces.contains
    for one, other in zip(whole.parts, pieces.parts, strict=True):
        assert one.name == other.name
        np.testing.assert_array_equal(corners(one), corners(other))
        np.testing.assert_array_equal(one.uvs[0], other.uvs[0])


@pytest.mark.parametrize(("text", "line", "error"), [
    ("f 1 2 3\nf 1 2 4\nf 5 1 2\n", 5, "indices of vertices up to 3, got 2 faces with higher ones"),
    ("vt 0 0\nf 1/1 2/1 3/2\n", 5, "indices of texture coordinates up to 1, got 1 faces"),
    ("f 1//1 2//1 3//1\n", 4, "indices of normals up to 0, got 1 faces"),
    ("f 1 2 0\n", 4, "got 1 faces with the index 0"), ("f -1 -2 -4\n", 4, "got 1 faces that reach too far"),
    ("f 1 2 3\nf 1 2\nf 1\n", 5, "faces of 3 to 65535 corners, got 2 with other than that"),
    ("f 1 2 x\n", 4, "faces of numbers, got 1 with something else"), ("f 1.5 2 3\n", 4, "faces of numbers"),
    ("f 1 2 3x\n", 4, "faces of numbers"), ("f 1-2 3\n", 4, "3 to 65535 corners"), ("f 1 2-3 3\n", 4, "of numbers"),
    ("f /1 2 3\n", 4, "corners are all of one form"), ("f 1/1 2 3\n", 4, "corners are all of one form"),
    ("f 1/1/1/1 2/1/1/1 3/1/1/1\n", 4, "corners are all of one form"), ("f 99999999999999999999 2 3\n", 4, "up to 3"),
    ("v 1 nan 1\nf 1 2 3\nv inf 0 0", 4, "finite vertices, got 2 with NaN, Inf or"),
    ("v 1 1e999 1\nf 1 2 3\n", 4, "finite vertices, got 1"), ("v 1 1e300 1\nf 1 2 3\n", 4, "got 1 with"),
    ("v 1 2\nf 1 2 3\n", 4, "vertices of 3, 4, 6 or 7 numbers"),
    ("v 1,5 2 3\nf 1 2 3\n", 4, "vertices of numbers"), ("v 1 two 3\nf 1 2 3\n", 4, "vertices of numbers"),
    ("v 1 2 3 4 5\nf 1 2 3\n", 4, "vertices of 3, 4, 6 or 7"),
    ("vt 0 x\nf 1 2 3\n", 4, "texture coordinates of numbers"),
    ("f 1 2 3\ncall more.obj\n", 5, "no statement that reads other files or runs commands"),
    ("csh rm -r x\nf 1 2 3\n", 4, "no statement that reads other files or runs commands"),
    ("f 1 2 3\nf 1 2", 5, "3 to 65535 corners"), ("f 1 2 3\nuseme", 5, "a whole last line"),
    ("f 1 2 3\nv 0.5 0.", 5, "vertices of 3"), ("f 1/1 2/1 3", 4, "all of one form"),
])
def test_what_breaks_the_format_is_refused_with_its_line(tmp_path, text, line, error):
    with pytest.raises(UserError) as caught:
        obj(tmp_path, TRIANGLE + text)
    assert any(f"a.obj: line {line}: expected" in str(problem) and error in str(problem)
               for problem in caught.value.problems), caught.value


def test_lines_are_counted_as_written(tmp_path):
    for text in (TRIANGLE.replace("\n", "\r\n"), TRIANGLE.replace("\n", "\r"),
                 TRIANGLE.replace("0 0\n", "\\\n0 0\n", 1)):
        with pytest.raises(UserError, match=rf"line {4 + text.count(chr(92))}: expected indices"):
            obj(tmp_path, text + "f 1 2 4\n")


def test_bytes_that_are_no_text_and_files_without_faces(tmp_path):
    with pytest.raises(UserError, match="a NUL byte in line 2"):
        obj(tmp_path, TRIANGLE[:10] + "\0\0")
    with pytest.raises(UserError, match="expected triangles, got a file without any, with 2 lines of points"):
        obj(tmp_path, TRIANGLE + "p 1\np 2 3\n")
    with pytest.raises(UserError, match="expected triangles, got a file without any"):
        obj(tmp_path, "")


# Polygons

@pytest.mark.parametrize("start", range(6))
def test_a_concave_prism(tmp_path, start):
    """0.51 x 0.3, whichever corner its ends start at."""
    points, rings = prism(ELL, 0.3)
    obj(tmp_path, vertices(points) + faces([*(ring[start:] + ring[:start] for ring in rings[:2]), *rings[2:]]))
    mesh = load(tmp_path / "a.obj").mesh
    assert mesh.volume == pytest.approx(0.153)
    towards_back = mesh.area_normals[:, 1] / 2
    assert towards_back[towards_back > 1e-9].sum() == pytest.approx(0.51) and len(mesh.faces) == 20


def test_doorways_and_windows_stay_open(tmp_path):
    """A wall of 3 x 3 with a door of 1 x 2; one of 4 x 4 with a window of 2 x 2 whose outline touches itself."""
    wall = [(0, 0, 0), (1, 0, 0), (1, 2, 0), (2, 2, 0), (2, 0, 0), (3, 0, 0), (3, 3, 0), (0, 3, 0)]
    assert area(obj(tmp_path, vertices(wall) + faces([range(8)]))) == pytest.approx(7)
    frame = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0), (1, 1, 0), (1, 3, 0), (3, 3, 0), (3, 1, 0)]
    model = obj(tmp_path, vertices(frame) + faces([(0, 1, 2, 3, 0, 4, 5, 6, 7, 4)]))
    assert area(model) == pytest.approx(12) and not model.left_out


def test_corners_keep_their_texture_coordinates(tmp_path):
    points = [(x, y, 0) for x, y in ELL]
    text = vertices(points) + "".join(f"vt {x} {y}\n" for x, y in ELL) + "f " + " ".join(
        f"{k}/{k}" for k in (6, 1, 2, 3, 4, 5)) + "\n"
    part = obj(tmp_path, text).parts[0]
    np.testing.assert_array_equal(corners(part)[..., :2], part.uvs[0])


def test_repeated_corners_and_crossing_outlines(tmp_path):
    square = vertices([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    assert area(obj(tmp_path, square + "f 1 1 2 3 3 4\n")) == pytest.approx(1)
    bow = vertices([(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 1, 0)])
    assert obj(tmp_path, bow + "f 1 2 3 4\n").left_out == ("1 face whose outline crosses itself, first face 0",)


# What else it holds

def test_parts_are_those_of_objects_and_materials(tmp_path):
    text = TRIANGLE + "f 1 2 3\no chair\nusemtl oak\nf 1 2 3\ng leg\nf 1 2 3\nusemtl steel\nf 3 2 1\no chair\n" \
        "usemtl oak\nf 2 3 1\n"
    model = obj(tmp_path, "mtllib l.mtl\n" + text, l="newmtl steel\nnewmtl oak\nnewmtl spare\n")
    assert [(part.name, len(part.faces), part.material) for part in model.parts] == [
        ("'no object', 'no material'", 1, -1), ("'chair', 'oak'", 2, 0), ("'leg', 'oak'", 1, 0),
        ("'leg', 'steel'", 1, 1)]
    assert [each.material.name for each in model.materials] == ["oak", "steel"]
    assert model.contains == "2 objects or groups, 5 faces, 5 triangles, 2 of 3 materials used"


def test_a_thousand_groups_are_not_kept_apart(tmp_path, monkeypatch):
    text = "mtllib l.mtl\n" + TRIANGLE + "".join(f"g {k}\nusemtl m{k % 2}\nf 1 2 3\n" for k in range(6))
    monkeypatch.setattr("dataset_builder.assets.readers.obj.MOST_PARTS", 5)
    model = obj(tmp_path, text, l="newmtl m0\nnewmtl m1\n")
    assert [(len(part.faces), part.material) for part in model.parts] == [(3, 0), (3, 1)]


def test_texture_coordinates_without_a_material_are_grey(tmp_path):
    obj(tmp_path, TRIANGLE + "vt 0 0\nf 1/1 2/1 3/1\n")
    asset = load(tmp_path / "a.obj")
    assert asset.materials[asset.mesh.material[0]].base_color == (0.6, 0.6, 0.6)
    assert asset.materials[asset.mesh.material[0]].texture is None


def test_what_is_not_read_is_named_with_counts(tmp_path):
    text = TRIANGLE + "usemtl gold\nf 1 2 3\nf 3 2 1\nl 1 2\nl 2 3\np 1\ncstype bezier\ncurv 0 1 1 2\n" \
        "surf 0 1 0 1 1\nlod 3\nv 0 0 0 0.5\nvt 0 0 0.5\ns 1\ng\n"
    left_out = obj(tmp_path, text).left_out
    assert left_out[0] == "material 'gold' of 2 faces, which no library defines"
    for words in ("2 lines of edges", "1 lines of points", "1 lines of 'cstype'", "1 lines of 'curv'",
                  "1 lines of 'surf'", "1 lines of 'lod'", "1 weights of vertices", "1 third texture coordinates"):
        assert words in left_out
    assert obj(tmp_path, TRIANGLE + "# curv\nvn 0 0 1\ns off\no a\nf 1//1 2//1 3//1 # f 1\n").left_out == ()


def test_vertex_colours_are_srgb_and_belong_to_vertices(tmp_path):
    text = "mtllib l.mtl\nv 0 0 0 1 0 0.5\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1 0.25\nv 1 1 0\nf 1 2 3\nusemtl m\nf 2 4 3\n"
    model = obj(tmp_path, text, l="newmtl m\nKd 0.5 0.5 0.5\n")
    np.testing.assert_allclose(model.parts[0].colors[0], [(1, 0, 0.2140411, 1), (0, 1, 0, 1), (0, 0, 1, 0.25)],
                               rtol=1e-5)
    np.testing.assert_allclose(model.parts[1].colors[0, 1], (1, 1, 1, 1))
    assert [part.material for part in model.parts] == [-1, 0]
    asset = load(tmp_path / "a.obj")
    assert [asset.materials[index].base_color[0] for index in asset.mesh.material] == [1.0, 0.5]
    bytes_ = obj(tmp_path, text.replace("1 0 0.5", "255 0 128"), l="newmtl m\n")
    np.testing.assert_allclose(bytes_.parts[0].colors[0, 0], (1, 0, 0.2158605, 1), rtol=1e-5)
    assert "vertex colours above 1 read as counted up to 255" in bytes_.left_out
    over = obj(tmp_path, text.replace("1 0 0.5", "1.02 -0.1 0.5"), l="newmtl m\n")
    np.testing.assert_allclose(over.parts[0].colors[0, 0], (1, 0, 0.2140411, 1), rtol=1e-5)
    assert over.left_out == ("2 values of vertex colours beyond 0 to 1, clipped",)


def test_blanks_and_continued_lines(tmp_path):
    text = "\ufeff  v\t0 0 0 \r\nv  1 0 0\r\n v 0 1 0\r\nvt 0 0\r\nf  1/1/ \\\r\n2/1/\t3/1/  \r\nf 1// 2// 3//"
    model = obj(tmp_path, text)
    assert sum(len(part.faces) for part in model.parts) == 2 and model.left_out == ()


def test_faces_without_texture_coordinates_under_a_texture_are_named(tmp_path):
    (tmp_path / "w.png").write_bytes(png([[[9, 9, 9]]]))
    model = obj(tmp_path, TRIANGLE + "mtllib l.mtl\nvt 0 0\nusemtl m\nf 1 2 3\nf 1/1 2/1 3/1\nf 2 1 3\n",
                l="newmtl m\nmap_Kd w.png\n")
    assert model.left_out == ("m: 2 faces have no texture coordinates, and take one texel",)
    nan = obj(tmp_path, TRIANGLE + "vt nan 0\nf 1/1 2/1 3/1\n")
    assert "1 texture coordinates that are not finite, taken as (0, 0)" in nan.left_out
    assert not nan.parts[0].uvs[0].any()


# Libraries

def test_textures_lie_where_their_coordinates_put_them(tmp_path):
    """Lower left of the square is the lower left texel, which is blue."""
    colors = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]]
    (tmp_path / "w.png").write_bytes(png(colors))
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    model = obj(tmp_path, "mtllib l.mtl\n" + square + "usemtl m\nf 1/1 2/2 3/3 4/4\n", l="newmtl m\nmap_Kd w.png\n")
    part, texture = model.parts[0], model.materials[0].material.texture
    np.testing.assert_array_equal(part.uvs[0], corners(part)[..., :2])
    np.testing.assert_array_equal(texture.base_color[1, 0], (0, 0, 1))


def test_maps_lie_beside_their_library_whatever_their_options(tmp_path):
    (folder := tmp_path / "mats").mkdir()
    (tmp_path / "a.obj").write_text("mtllib mats\\a.mtl\n" + TRIANGLE + "usemtl m\nf 1 2 3\n")
    (folder / "a.mtl").write_text("newmtl m\nmap_Kd -s 1 1 1 -clamp on old oak.png\n")
    (tmp_path / "old oak.png").write_bytes(png([[[0, 0, 0]]]))
    with pytest.raises(UserError, match=r"mats/a.mtl: line 2: map_Kd: expected an existing file, got old oak.png"):
        load(tmp_path / "a.obj")
    (folder / "old oak.png").write_bytes(png([[[255, 0, 0]]]))
    np.testing.assert_array_equal(load(tmp_path / "a.obj").materials[0].texture.base_color, [[(1, 0, 0)]])


def test_every_missing_file_is_named_at_once(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nmtllib b.mtl\n" + TRIANGLE + "usemtl m\nf 1 2 3\n")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd oak.png\n")
    with pytest.raises(UserError) as caught:
        load(tmp_path / "a.obj")
    assert len(caught.value.problems) == 2
    assert "a.mtl: line 2: map_Kd: expected an existing file, got oak.png" in str(caught.value)
    assert "a.obj: line 2: mtllib: expected an existing file, got b.mtl" in str(caught.value)


def test_several_libraries_and_names_on_a_line(tmp_path):
    (tmp_path / "old oak.mtl").write_text("newmtl c\nKd 0 0 1\n")
    text = "mtllib x.mtl y.mtl\nmtllib old oak.mtl\n" + TRIANGLE + "".join(
        f"usemtl {name}\nf 1 2 3\n" for name in "abc")
    model = obj(tmp_path, text, x="newmtl a\nKd 1 0 0\n", y="newmtl b\nKd 0 1 0\n")
    assert [each.material.base_color for each in model.materials] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]


def test_of_two_materials_of_a_name_the_last_counts_and_that_is_said(tmp_path):
    text = "mtllib x.mtl\nmtllib y.mtl\n" + TRIANGLE + "usemtl a\nf 1 2 3\n"
    model = obj(tmp_path, text, x="newmtl a\nKd 1 0 0\n", y="newmtl a\nKd 0 1 0\n")
    assert model.materials[0].material.base_color == (0, 1, 0)
    assert model.left_out == ("material 'a' is defined 2 times, and the last counts",)


def test_names_of_materials_may_hold_blanks_or_be_followed_by_a_comment(tmp_path):
    text = "mtllib l.mtl\n" + TRIANGLE + "usemtl  old oak \nf 1 2 3\nusemtl b#1 # plain\nf 1 2 3\n"
    model = obj(tmp_path, text, l="newmtl old oak\nKd 1 0 0\nnewmtl b#1\nKd 0 1 0\nnewmtl b#2\n")
    assert [each.material.base_color[0] for each in model.materials] == [1, 0] and not model.left_out


def test_a_hundred_thousand_squares_are_read_at_once(tmp_path):
    """What a loop over lines would take long for; memory stays in proportion to the file."""
    side = 300
    y, x = np.mgrid[0:side + 1, 0:side + 1]
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side) + 1).ravel()
    rings = np.stack([first, first + 1, first + side + 2, first + side + 1], axis=1)
    text = "".join(f"v {a} {b} 0\n" for a, b in zip(x.ravel(), y.ravel(), strict=True)) + "".join(
        f"f {a} {b} {c} {d}\n" for a, b, c, d in rings)
    (tmp_path / "a.obj").write_text(text)
    tracemalloc.start()
    model = read(tmp_path / "a.obj", 64)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(model.parts[0].faces) == 2 * side**2 and area(model) == pytest.approx(side**2)
    assert peak < 40 * len(text)


# Whatever the bytes are

VALID = (TRIANGLE + "v 1 1 0 1 0 0\nvt 0 0\nvn 0 0 1\nmtllib a.mtl\nusemtl m\no a\ng b\nf 1/1/1 2/1/1 4/1/1 3/1/1\n"
         "f -4 -3 -2 \\\n -1\nl 1 2\n").encode()
WORDS = [b"v", b"vt", b"f", b"l", b"g", b"usemtl", b"mtllib", b" ", b"\n", b"\r", b"/", b"//", b"-", b"0", b"1", b"2",
         b"3", b"-1", b"1e308", b"nan", b"#", b"\\\n", b"../x", b"a.mtl", b"\t", b"\xff", b"\0", b"call", b"1/1/1"]


def holds(folder: Path, data: bytes) -> None:
    """Reading ends with an asset or with a clear error."""
    (folder / "a.obj").write_bytes(data)
    try:
        load(folder / "a.obj")
    except UserError as error:
        assert "expected" in str(error)


FUZZ = settings(max_examples=300, deadline=None, derandomize=True, database=None,
                suppress_health_check=[HealthCheck.function_scoped_fixture])


@FUZZ
@given(data=st.one_of(st.binary(max_size=200), st.lists(st.sampled_from(WORDS), max_size=60).map(b" ".join),
                      st.lists(st.sampled_from(WORDS), max_size=60).map(lambda words: VALID + b"".join(words))))
def test_any_bytes_end_in_an_asset_or_a_clear_error(tmp_path, data):
    holds(tmp_path, data)


@FUZZ
@given(edits=st.lists(st.tuples(st.integers(0, len(VALID) - 1), st.integers(0, 12), st.sampled_from(WORDS)),
                      max_size=4))
def test_a_damaged_file_ends_in_an_asset_or_a_clear_error(tmp_path, edits):
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0 0\n")
    data = VALID
    for place, length, word in edits:
        data = data[:place] + word + data[place + length:]
    holds(tmp_path, data)
