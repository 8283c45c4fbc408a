"""Primitives of glTF: modes, indices, vertex colours, morph targets."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.errors import UserError
from tests.assets.gltf_files import COLORS, QUAD, QUAD_FACES, QUAD_UVS, GltfMaker, quad_of

RED = np.array([[1, 0, 0]] * 4, np.float32)


def area(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(positions[faces], 1, 0)
    return np.cross(b - a, c - a).sum(axis=0) / 2


@pytest.mark.parametrize(("mode", "faces"), [
    (4, QUAD_FACES), (5, np.array([0, 1, 3, 2], np.uint8)), (6, np.array([0, 1, 2, 3], np.uint32)),
    (5, np.array([1, 2, 0, 3], np.uint16)), (6, None)])
def test_triangles_strips_and_fans_are_the_same_quad(tmp_path: Path, mode: int, faces: np.ndarray | None) -> None:
    made = GltfMaker()
    made.draw(made.primitive(faces=faces, mode=mode))
    model = made.model(tmp_path)
    part, = model.parts
    assert len(part.faces) == 2 and "2 triangles of 2" in model.contains
    np.testing.assert_allclose(area(part.positions, part.faces), (0, 0, 1))


def test_a_longer_strip_keeps_its_winding(tmp_path: Path) -> None:
    made = GltfMaker()
    zigzag = np.array([[k // 2, -(k % 2), 0] for k in range(7)], np.float32)
    made.draw(made.primitive(zigzag, None, mode=5))
    part, = made.model(tmp_path).parts
    corners = part.positions[part.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert len(part.faces) == 5
    np.testing.assert_allclose(normals, np.broadcast_to((0, 0, 1), normals.shape))


def test_points_and_lines_are_named_with_their_numbers(tmp_path: Path) -> None:
    made = GltfMaker()
    made.draw(made.primitive(), made.primitive(faces=None, mode=0), made.primitive(mode=1), made.primitive(mode=3))
    model = made.model(tmp_path)
    assert len(model.parts) == 1 and model.contains.startswith("1 mesh, 1 primitive, 2 triangles of 2")
    assert model.left_out[:-1] == ("points (4 vertices)", "lines (6 vertices)", "line strips (6 vertices)")


def test_triangles_without_area_are_kept_for_the_repair(tmp_path: Path) -> None:
    made = GltfMaker()
    made.draw(made.primitive(faces=np.array([0, 1, 2, 0, 0, 2, 0, 2, 3], np.uint16)))
    assert len(made.model(tmp_path).parts[0].faces) == 3
    asset = made.asset(tmp_path)
    assert len(asset.mesh.faces) == 2 and "1 degenerate" in asset.meta["repair"]


@pytest.mark.parametrize(("faces", "mode", "rule"), [
    ([0, 1, 2, 0, 2, 9], 4, "expected indices below 4, its number of vertices, got 1 of 6 that are not, first 9 at"
                            " corner 5"),
    ([0, 1, 2, 3], 4, "expected indices by threes, got 4"),
    ([0, 1, 65535, 2], 5, "expected indices below 4.*first 65,535"),
    ([0, 1, 2], 7, r"mode: expected a whole number in \[0, 6\], got 7")])
def test_indices_that_lead_nowhere(tmp_path: Path, faces: list[int], mode: int, rule: str) -> None:
    made = GltfMaker()
    made.draw(made.primitive(faces=np.array(faces, np.uint16), mode=mode))
    with pytest.raises(UserError, match=rf"meshes\[0\]\.primitives\[0\].*{rule}"):
        made.model(tmp_path)


def test_coordinates_and_colours_that_are_too_few(tmp_path: Path) -> None:
    made = quad_of({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, [COLORS])
    made.header["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = made.accessor(QUAD_UVS[:3])
    with pytest.raises(UserError, match="expected 4 texture coordinates, one a vertex, got 3"):
        made.model(tmp_path)
    made = GltfMaker()
    made.draw(made.primitive(COLOR_0=RED[:2]))
    with pytest.raises(UserError, match="expected 4 colours, one a vertex, got 2"):
        made.model(tmp_path)


def test_only_vertices_that_are_used_come_along(tmp_path: Path) -> None:
    """Primitives that share one large array of vertices must not copy it each."""
    made = GltfMaker()
    shared = made.accessor(np.concatenate([QUAD, QUAD + 9]).astype(np.float32))
    made.draw(*(made.primitive(shared, np.array(face, np.uint16)) for face in ([4, 5, 6], [0, 1, 2])))
    first, second = made.model(tmp_path).parts
    np.testing.assert_array_equal(first.positions, QUAD[:3] + 9)
    np.testing.assert_array_equal(second.positions, QUAD[:3])


@pytest.mark.parametrize(("values", "normalized"), [
    (np.array([[255, 51, 0]] * 4, np.uint8), True), (np.array([[65535, 13107, 0]] * 4, np.uint16), True),
    (np.array([[1, 0.2, 0]] * 4, np.float32), False), (np.array([[255, 51, 0]] * 4, np.uint8), False)])
def test_vertex_colours_are_linear_whatever_their_type(tmp_path: Path, values: np.ndarray, normalized: bool) -> None:
    """Whole numbers can only mean normalised ones, which some writers forget to say."""
    made = GltfMaker()
    colors = made.accessor(values, **({"normalized": True} if normalized else {}))
    made.draw(made.primitive(COLOR_0=colors, material=made.add("materials", name="m", doubleSided=True)))
    part, = made.model(tmp_path).parts
    np.testing.assert_allclose(part.colors, np.broadcast_to((1, 0.2, 0, 1), (2, 3, 4)), rtol=1e-6)


@pytest.mark.parametrize(("mode", "coverage"), [("OPAQUE", 1), ("MASK", 0.25), ("BLEND", 0.25)])
def test_coverage_of_vertices_counts_where_the_material_has_any(tmp_path: Path, mode: str, coverage: float) -> None:
    made = quad_of({"alphaMode": mode}, COLOR_0=np.array([[1, 1, 1, 0.25]] * 4, np.float32))
    np.testing.assert_allclose(made.model(tmp_path).parts[0].colors[..., 3], coverage)


def test_colours_without_a_material_lie_on_white(tmp_path: Path) -> None:
    made = GltfMaker()
    made.draw(made.primitive(COLOR_0=np.array([[0.5] * 3] * 3 + [[0.25] * 3], np.float32)),
              made.primitive(QUAD + 2))
    model, asset = made.model(tmp_path), made.asset(tmp_path)
    assert [part.material for part in model.parts] == [-1, -1] and "2 primitives without a material" in model.left_out
    assert {asset.materials[index].base_color for index in asset.mesh.material} == {(1.0, 1.0, 1.0), (0.6, 0.6, 0.6)}
    np.testing.assert_allclose(np.unique(asset.mesh.colors), [0.25, 0.5, 1])


def test_colours_beyond_one_are_cut_and_counted(tmp_path: Path) -> None:
    made = GltfMaker()
    made.draw(made.primitive(COLOR_0=np.array([[2, 0, 0], [1, 0, 0], [0, -1, 0], [0, 0, 0]], np.float32)))
    model = made.model(tmp_path)
    assert model.parts[0].colors.min() == 0 and model.parts[0].colors.max() == 1
    assert model.left_out[0] == "meshes[0].primitives[0]: 2 vertex colours beyond 1, taken as 1"


@pytest.mark.parametrize(("mesh", "node", "height"), [
    ({}, {}, 1), ({"weights": [0.5, 0]}, {}, 1.5), ({"weights": [0.5, 0]}, {"weights": [0, 1]}, 1.25)])
def test_morph_targets_at_the_weights_that_are_stated(tmp_path: Path, mesh: dict, node: dict, height: float) -> None:
    """The upper edge is lifted by 1 in the first target and by a quarter in the second; a node's weights come first."""
    made = GltfMaker()
    lifts = [np.array([[0, 0, 0], [0, 0, 0], [0, lift, 0], [0, lift, 0]], np.float32) for lift in (1, 0.25)]
    targets = [{"POSITION": made.accessor(lift)} for lift in lifts]
    made.draw(made.primitive(targets=targets), mesh=mesh, **node)
    model = made.model(tmp_path)
    assert model.parts[0].positions[:, 1].max() == height
    assert "morph targets at the weights that the file states" in model.left_out


def test_morph_targets_that_do_not_fit(tmp_path: Path) -> None:
    made = GltfMaker()
    made.draw(made.primitive(targets=[{"POSITION": made.accessor(QUAD[:3])}]), mesh={"weights": [1]})
    with pytest.raises(UserError, match=r"targets\[0\].POSITION: expected \(4, 3\) numbers, got \(3, 3\)"):
        made.model(tmp_path)
    made.header["meshes"][0]["weights"] = [1, 1]
    with pytest.raises(UserError, match=r"meshes\[0\].weights: expected 1 finite numbers, got \[1, 1\]"):
        made.model(tmp_path)
