"""Every embedded family, at its usual parameters and at the corners of its ranges."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.procedural.furniture import FINISHES, MAKERS, make_furniture
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.seeding import rng
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.numbers import draw, support

VARIANTS = ("draw-0", "draw-1", "low", "high", "mixed-0", "mixed-1", "mixed-2")
CASES = [(family, variant) for family in FAMILIES for variant in VARIANTS]


def params_of(family: str, variant: str) -> dict[str, float]:
    """Drawn from the defaults, or every parameter at a limit: all low, all high, or each at random."""
    kind, _, index = variant.partition("-")
    streams = {param.name: rng(int(index or 0), "test", family, param.name) for param in FAMILIES[family].params}
    if kind == "draw":
        return {param.name: draw(param.default, streams[param.name]) for param in FAMILIES[family].params}
    if kind == "mixed":
        return {param.name: (param.low, param.high)[int(streams[param.name].integers(2))]
                for param in FAMILIES[family].params}
    return {param.name: getattr(param, kind) for param in FAMILIES[family].params}


@cache
def made(family: str, variant: str) -> Asset:
    return make_furniture(family=family, params=params_of(family, variant), seed=3, name=f"test-{family}")


def components(mesh: TriangleMesh) -> list[np.ndarray]:
    """(F_k, 3) faces of every connected part."""
    a, b = mesh.faces[:, [0, 1, 0]].ravel(), mesh.faces[:, [1, 2, 2]].ravel()
    size = len(mesh.positions)
    _, label = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(size, size)), directed=False)
    of_face = label[mesh.faces[:, 0]]
    return [mesh.faces[of_face == k] for k in np.unique(of_face)]


def winding(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(P,) winding numbers of a closed surface (F, 3, 3): solid angles (van Oosterom and Strackee 1983) over 4 pi."""
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    top = np.einsum("pfi,pfi->pf", a, np.cross(b, c))
    dot = np.einsum
    bottom = (la * lb * lc + dot("pfi,pfi->pf", a, b) * lc + dot("pfi,pfi->pf", b, c) * la
              + dot("pfi,pfi->pf", c, a) * lb)
    return np.arctan2(top, bottom).sum(axis=1) / (2 * np.pi)


def shrunk(mesh: TriangleMesh, faces: np.ndarray, depth: float) -> np.ndarray:
    """Vertices of a part moved inwards by `depth`."""
    normals = np.zeros_like(mesh.positions)
    corners = mesh.positions[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for corner in range(3):
        np.add.at(normals, faces[:, corner], face_normals)
    used = np.unique(faces)
    return mesh.positions[used] - depth * normals[used] / np.linalg.norm(normals[used], axis=1, keepdims=True)


def overlaps(mesh: TriangleMesh, *, depth: float = 1e-4, samples: int = 120) -> list[tuple[int, int]]:
    """Pairs of parts that share volume: a shrunken vertex of one in the other, or a random point in both."""
    parts, found = components(mesh), []
    stream = np.random.default_rng(0)
    corners = [mesh.positions[faces] for faces in parts]
    bounds = [(c.min(axis=(0, 1)), c.max(axis=(0, 1))) for c in corners]
    vertices = [shrunk(mesh, faces, depth) for faces in parts]
    for i in range(len(parts)):
        for j in range(i + 1, len(parts)):
            low, high = np.maximum(bounds[i][0], bounds[j][0]), np.minimum(bounds[i][1], bounds[j][1])
            if (high - low < 1e-6).any():
                continue
            common = stream.uniform(low, high, size=(samples, 3))
            both = (winding(common, corners[i]) > 0.5) & (winding(common, corners[j]) > 0.5)
            pierced = [winding(v[((v > low) & (v < high)).all(axis=1)], corners[k]).max(initial=0) > 0.5
                       for v, k in ((vertices[i], j), (vertices[j], i))]
            if both.any() or any(pierced):
                found.append((i, j))
    return found


def test_every_family_has_a_maker_and_honest_limits() -> None:
    assert set(MAKERS) == set(FAMILIES)
    assert len({family.category for family in FAMILIES.values()}) >= 12
    for family in FAMILIES.values():
        for param in family.params:
            smallest, largest = support(param.default)
            assert param.low <= smallest <= largest <= param.high, (family.name, param.name)


@pytest.mark.parametrize(("family", "variant"), CASES)
def test_mesh_is_closed_outward_and_stands_centred(family: str, variant: str) -> None:
    mesh = made(family, variant).mesh
    edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    there, back = (edges[:, i] * len(mesh.positions) + edges[:, 1 - i] for i in (0, 1))
    assert len(np.unique(there)) == len(there)
    np.testing.assert_array_equal(np.sort(there), np.sort(back))
    for faces in components(mesh):
        corners = mesh.positions[faces]
        inside = corners.mean(axis=(0, 1))
        assert np.einsum("ij,ij->", corners[:, 0] - inside,
                         np.cross(corners[:, 1] - inside, corners[:, 2] - inside)) > 0
    assert mesh.bounds[0, 2] == 0
    np.testing.assert_allclose(mesh.bounds.mean(axis=0)[:2], 0, atol=1e-9)
    assert (np.linalg.norm(mesh.area_normals, axis=1) > 1e-9).all()


@pytest.mark.parametrize(("family", "variant"), CASES)
def test_asset_has_used_materials_finite_coordinates_and_real_size(family: str, variant: str) -> None:
    asset = made(family, variant)
    mesh = asset.mesh
    assert 200 <= len(mesh.faces) <= 6000
    assert 1 <= len(asset.materials) <= 4
    np.testing.assert_array_equal(np.unique(mesh.material), np.arange(len(asset.materials)))
    assert np.isfinite(mesh.uvs).all()
    low, high = mesh.bounds
    assert ((high - low) > 0.1).all()
    assert ((high - low) < (3.1, 2.4, 2.45)).all()
    params = params_of(family, variant)
    if family not in ("dining_table", "coffee_table", "stool", "bed"):
        assert (high - low)[0] == pytest.approx(params.get("width", (high - low)[0]), rel=0.2)
    if "height" in params and family != "bed":
        pile = 0.125 * (params.get("books", 0) > 0)
        assert params["height"] - 0.01 <= high[2] <= params["height"] + pile + 0.01


@pytest.mark.parametrize(("family", "variant"), CASES)
def test_no_two_parts_share_volume(family: str, variant: str) -> None:
    assert overlaps(made(family, variant).mesh) == []


def test_overlaps_are_found() -> None:
    from dataset_builder.assets.procedural.boxes import bevelled_box
    from dataset_builder.geometry.mesh import concatenate, transform
    cube, shift = bevelled_box((1, 1, 1), bevel=0.01), np.eye(4)
    shift[0, 3] = 0.9
    assert overlaps(concatenate([cube, transform(cube, shift)])) == [(0, 1)]
    shift[0, 3] = 1.0003
    assert overlaps(concatenate([cube, transform(cube, shift)])) == []


def test_same_arguments_give_the_same_arrays_and_another_seed_another_look() -> None:
    params = params_of("sofa", "draw-0")
    one, two, other = (make_furniture(family="sofa", params=params, seed=seed, name="a") for seed in (0, 0, 1))
    for field in ("positions", "faces", "uvs", "material"):
        np.testing.assert_array_equal(getattr(one.mesh, field), getattr(two.mesh, field))
    assert [m.name for m in one.materials] == [m.name for m in two.materials]
    for first, second in zip(one.materials, two.materials, strict=True):
        if first.texture is not None and second.texture is not None:
            np.testing.assert_array_equal(first.texture.base_color, second.texture.base_color)
    np.testing.assert_array_equal(one.mesh.positions, other.mesh.positions)
    assert [m.name for m in one.materials] != [m.name for m in other.materials]


def test_a_parameter_changes_the_shape_and_no_material() -> None:
    params = params_of("bookshelf", "draw-0")
    one, two = (make_furniture(family="bookshelf", params=params | {"shelves": n}, seed=5, name="a")
                for n in (3.0, 5.0))
    assert len(one.mesh.faces) != len(two.mesh.faces)
    assert [m.name for m in one.materials] == [m.name for m in two.materials]


def test_surfaces_spread_from_matte_to_glossy_and_metallic() -> None:
    materials = [m for family, variant in CASES for m in made(family, variant).materials]
    materials += [m for family in FAMILIES for s in range(6) for m in make_furniture(
        family=family, params=params_of(family, "draw-0"), seed=s, name="a").materials]
    assert any(m.metallic == 1 for m in materials)
    assert any(m.specular == 0 for m in materials)
    assert any(m.roughness < 0.3 and not m.metallic for m in materials)
    for material in materials:
        texture = material.texture
        colour = np.asarray(material.base_color) * (1.0 if texture is None else texture.base_color)
        brightest = 1.0 if material.transmission else 0.85
        assert colour.min() >= 0.03 - 1e-6 and colour.max() <= brightest + 1e-6


@pytest.mark.parametrize(("change", "words"), [
    ({"width": None}, "missing; chair needs width, depth"), ({"wide": 1.0}, "unknown; chair has width"),
    ({"width": 9.0}, r"expected in \[0.38, 0.6\], got 9"), ({"width": float("nan")}, "got nan")])
def test_wrong_parameters_are_named(change: dict[str, float | None], words: str) -> None:
    params = {key: value for key, value in (params_of("chair", "low") | change).items() if value is not None}
    with pytest.raises(UserError, match=words):
        make_furniture(family="chair", params=params, seed=0, name="bad")


def test_unknown_family_is_named() -> None:
    with pytest.raises(UserError, match=r"expected one of chair, .* got throne"):
        make_furniture(family="throne", params={}, seed=0, name="bad")


def test_materials_are_called_by_what_they_are_there_for() -> None:
    found: dict[str, set[str]] = {family: set() for family in FAMILIES}
    for family, variant in CASES:
        names = [material.name for material in made(family, variant).materials]
        assert all(": " in name for name in names)
        found[family] |= {name.partition(": ")[0] for name in names}
    assert found == {family: set(roles) for family, roles in FINISHES.items()}


def test_glass_and_lacquer_are_made_where_they_are_asked_for() -> None:
    for family, there in (("vase", lambda m: m.transmission == 1), ("cabinet", lambda m: m.coat == 1)):
        plain, fine = (make_furniture(family=family, params={**params_of(family, "draw-0"), "finish": finish}, seed=3,
                                      name="a") for finish in (0, 1))
        assert not any(map(there, plain.materials)) and any(map(there, fine.materials))
        np.testing.assert_array_equal(plain.mesh.positions, fine.mesh.positions)
