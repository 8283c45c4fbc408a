"""Implicit shapes and subdivision surfaces of USD become the triangles that they describe."""

import numpy as np
import pytest

from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers.usd import read
from dataset_builder.assets.readers.usd_cages import MESH_TRIANGLES, STAGE_TRIANGLES, rounds_of
from dataset_builder.errors import UserError
from tests.assets.readers.usd_files import HEAD, mesh, painted, texture, write, write_image

CUBE = {"points": "(-1,-1,-1), (1,-1,-1), (1,1,-1), (-1,1,-1), (-1,-1,1), (1,-1,1), (1,1,1), (-1,1,1)",
        "counts": "4, 4, 4, 4, 4, 4", "indices": "0,3,2,1, 4,5,6,7, 0,1,5,4, 1,2,6,5, 2,3,7,6, 3,0,4,7"}
ALL_EDGES = "[0,3, 3,2, 2,1, 1,0, 4,5, 5,6, 6,7, 7,4, 0,4, 1,5, 2,6, 3,7]"
TWICE = "subdivision surfaces (catmullClark) taken after two rounds, values of face corners linear"
ROUND = np.sin(2 * np.pi / 32) / (2 * np.pi / 32)
"""Area of a polygon of 32 sides over its circle's."""


def load(path):
    return load_mesh_file(path, name="a", category="b", licence="CC0-1.0").mesh


def volume(part):
    a, b, c = np.moveaxis(part.positions[part.faces], 1, 0)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def error_of(path):
    with pytest.raises(UserError) as caught:
        read(path, 16)
    return str(caught.value)


@pytest.mark.parametrize(("shape", "sizes", "extent", "expected"), [
    ("Cube", "double size = 3", (3, 3, 3), 27), ("Cube", "", (2, 2, 2), 8),
    ("Cylinder", 'double radius = 2\ndouble height = 3\nuniform token axis = "X"', (3, 4, 4), np.pi * 12 * ROUND),
    ("Cone", 'double radius = 2\ndouble height = 3\nuniform token axis = "Y"', (4, 3, 4), np.pi * 4 * ROUND),
    ("Cylinder_1", "double radiusTop = 0\ndouble radiusBottom = 1", (2, 2, 2), np.pi * 2 / 3 * ROUND),
    ("Sphere", "double radius = 2", (4, 4, 4), None), ("Capsule", "", (1, 1, 2), None),
    ("Capsule_1", "double radiusTop = 1\ndouble radiusBottom = 1\ndouble height = 2", (2, 2, 4), None)])
def test_shapes_have_their_size_and_volume(tmp_path, shape, sizes, extent, expected):
    (part,) = read(write(tmp_path, HEAD + f'def {shape} "a" {{\n{sizes}\n}}'), 16).parts
    np.testing.assert_allclose(np.ptp(part.positions, axis=0), extent)
    round_one = {"Sphere": 4 / 3 * np.pi * 8, "Capsule": np.pi * (4 / 3 / 8 + 1 / 4),
                 "Capsule_1": np.pi * (4 / 3 + 2)}.get(shape)
    assert volume(part) == pytest.approx(expected or round_one, rel=1e-9 if expected else 0.02)
    assert volume(part) <= (expected or round_one) + 1e-9
    edges = np.sort(np.concatenate([part.faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all(), "closed"


@pytest.mark.parametrize(("axis", "extent", "towards"), [("X", (0, 5, 3), 0), ("Y", (3, 0, 5), 1), ("Z", (3, 5, 0), 2)])
def test_a_plane_faces_its_axis(tmp_path, axis, extent, towards):
    text = f'def Plane "a" {{\ndouble width = 3\ndouble length = 5\nuniform token axis = "{axis}"\n}}'
    (part,) = read(write(tmp_path, HEAD + text), 16).parts
    np.testing.assert_allclose(np.ptp(part.positions, axis=0), extent)
    a, b, c = part.positions[part.faces[0]]
    assert np.argmax(np.cross(b - a, c - a)) == towards


def test_shapes_have_colours_and_refuse_sizes(tmp_path):
    blue = "color3f[] primvars:displayColor = [(0, 0, 1)]"
    (part,) = read(write(tmp_path, HEAD + f'def Sphere "a" {{\n{blue}\n}}'), 16).parts
    np.testing.assert_array_equal(part.colors[0, 0], (0, 0, 1, 1))
    assert "/a: expected a size of 0 or more, got radius -1" in error_of(
        write(tmp_path, HEAD + 'def Sphere "a" {\ndouble radius = -1\n}'))


def test_an_unset_scheme_is_catmull_clark(tmp_path):
    """The limit of a cube's corners is at half of it, which two rounds come within 1/108 of."""
    text = HEAD + mesh(**CUBE).replace('uniform token subdivisionScheme = "none"', "")
    model = read(write(tmp_path, text), 16)
    (part,) = model.parts
    assert len(part.faces) == 6 * 4 * 4 * 2 and model.left_out == (TWICE,)
    assert np.abs(part.positions[:8]).max() == pytest.approx(1 / 2 + 1 / 108)
    assert load(tmp_path / "a.usda").volume == pytest.approx(volume(part))


@pytest.mark.parametrize(("more", "expected"), [
    (f"int[] creaseIndices = {ALL_EDGES}\nint[] creaseLengths = [2,2,2,2,2,2,2,2,2,2,2,2]\n"
     "float[] creaseSharpnesses = [10,10,10,10,10,10,10,10,10,10,10,10]", 8),
    ("int[] creaseIndices = [0,1,2,3,0]\nint[] creaseLengths = [5]\nfloat[] creaseSharpnesses = [10,10,10,10]", None),
    ("int[] cornerIndices = [0,1,2,3]\nfloat[] cornerSharpnesses = [10,10,10,10]", None)])
def test_creases_and_corners_are_kept(tmp_path, more, expected):
    (part,) = read(write(tmp_path, HEAD + mesh(**CUBE, more=more, scheme="catmullClark")), 16).parts
    plain = read(write(tmp_path, HEAD + mesh(**CUBE, scheme="catmullClark"), "b.usda"), 16).parts[0]
    assert part.positions[:, 2].min() == -1 and plain.positions[:, 2].min() > -1
    assert volume(part) > volume(plain)
    assert expected is None or volume(part) == pytest.approx(expected)


def test_holes_boundaries_loop_and_bilinear(tmp_path):
    """A cube without its top: an open edge stays where it is, but for its corners if they are not kept."""
    def faces(text):
        return len(read(write(tmp_path, HEAD + text, "a.usda"), 16).parts[0].faces)

    assert faces(mesh(**CUBE, more="int[] holeIndices = [1]", scheme="catmullClark")) == 5 * 32
    grid = {"points": ", ".join(f"({x},{y},0)" for y in range(4) for x in range(4)), "counts": ", ".join(["4"] * 9),
            "indices": ", ".join(f"{i},{i + 1},{i + 5},{i + 4}" for i in (0, 1, 2, 4, 5, 6, 8, 9, 10))}
    rule = 'uniform token interpolateBoundary = "{}"'
    assert faces(mesh(**grid, more=rule.format("none"), scheme="catmullClark")) == 32
    for name, corner in (("edgeAndCorner", 0), ("edgeOnly", 0.15)):
        (part,) = read(write(tmp_path, HEAD + mesh(**grid, more=rule.format(name), scheme="catmullClark")), 16).parts
        assert part.positions[0, 0] == pytest.approx(corner, abs=0.02)
        assert len(part.faces) == 9 * 32
    triangles = {"points": CUBE["points"], "counts": "3, 3", "indices": "0,3,2, 0,2,1"}
    assert faces(mesh(**triangles, scheme="loop")) == 32
    assert faces(mesh(**CUBE, scheme="bilinear")) == 12, "flat faces stay as they are"
    bent = {"points": "(0,0,0), (1,0,0), (1,1,1), (0,1,0)", "counts": "4", "indices": "0,1,2,3"}
    (part,) = read(write(tmp_path, HEAD + mesh(**bent, scheme="bilinear")), 16).parts
    np.testing.assert_allclose(part.positions[:, 2], part.positions[:, 0] * part.positions[:, 1])
    model = read(write(tmp_path, HEAD + mesh(**CUBE, scheme="loop")), 16)
    assert (len(model.parts[0].faces), model.left_out) == (
        12, ("subdivision surfaces (loop) of faces that are no triangles, taken as their control cages",))


@pytest.mark.parametrize("how", ["faceVarying", "varying", "vertex"])
def test_coordinates_lie_on_the_refined_surface(tmp_path, how):
    """Coordinates that are the positions of a flat grid stay so: linear ones where the surface is, too."""
    write_image(tmp_path, "t.png", (255, 0, 0))
    st = f'texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] ( interpolation = "{how}" )'
    text = painted("color3f inputs:diffuseColor.connect = </paint/t.outputs:rgb>", nodes=texture("t", "t.png"), more=st)
    (part,) = read(write(tmp_path, text.replace('"none"', '"catmullClark"')), 16).parts
    assert len(part.faces) == 32
    np.testing.assert_allclose(part.uvs[0], part.positions[part.faces][..., :2], atol=1e-12)


def test_subsets_and_colours_of_faces_follow_their_faces(tmp_path):
    colors = ", ".join(f"({0.1 * number:.1f}, 0, 0)" for number in range(6))
    more = f'color3f[] primvars:displayColor = [{colors}] ( interpolation = "uniform" )'
    (part,) = read(write(tmp_path, HEAD + mesh(**CUBE, more=more, scheme="catmullClark")), 16).parts
    values, counts = np.unique(part.colors[:, 0, 0].round(5), return_counts=True)
    np.testing.assert_allclose(values, np.arange(6) / 10, atol=1e-5)
    assert (counts == 32).all()


@pytest.mark.parametrize(("more", "error"), [
    ("int[] creaseIndices = [0, 9]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1]",
     "expected creaseIndices in [0, 8), got 1 others, first 9"),
    ("int[] creaseIndices = [0, 1]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [1]", "that sum to the 2"),
    ("int[] creaseIndices = [0, 1]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1, 2]", "got 2"),
    ("int[] creaseIndices = [0, 1]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [nan]", "got NaN or Inf"),
    ("int[] cornerIndices = [-1]\nfloat[] cornerSharpnesses = [1]", "expected cornerIndices in [0, 8)"),
    ("int[] cornerIndices = [1]", "expected 1 cornerSharpnesses, one for each corner, got 0"),
    ('uniform token interpolateBoundary = "all"', "expected interpolateBoundary to be none, edgeOnly")])
def test_creases_that_make_no_sense_are_refused(tmp_path, more, error):
    assert error in error_of(write(tmp_path, HEAD + mesh(**CUBE, more=more, scheme="catmullClark")))


def test_rounds_stay_within_the_budget():
    generator = np.random.default_rng(3)
    for _ in range(50):
        sizes = generator.integers(0, 200_000, generator.integers(1, 400))
        chosen = np.array(rounds_of(sizes.tolist()))
        made = np.where(chosen > 0, 2 * sizes * 4.0 ** (chosen - 1), 0)
        assert made.max() <= MESH_TRIANGLES and made.sum() <= STAGE_TRIANGLES
    assert rounds_of([]) == [] and rounds_of([24]) == [2]
