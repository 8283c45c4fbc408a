"""Embedded rooms: closed parts, openings where windows are asked for, and no other way in for light."""

import numpy as np
import pytest

from dataset_builder.assets.procedural.rooms import LINTEL_HEIGHT, SILL_HEIGHT, THICKNESS, make_panes, make_room
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh

SIZE = {"width": 4.0, "depth": 3.0, "height": 2.5}
DIRECTIONS = {"+y": (0, 1, 0), "-x": (-1, 0, 0), "+x": (1, 0, 0), "-y": (0, -1, 0)}


def room(**changes: float) -> dict:  # type: ignore[type-arg]
    return make_room(**{**SIZE, "ceiling": True, "windows": 0, "skirting": 0.08, "seed": 1,
                        **changes})  # type: ignore[arg-type]


def hits(meshes: list[TriangleMesh], origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N,) distance to the nearest hit of each ray, inf where it leaves (Moeller and Trumbore 1997)."""
    corners = np.concatenate([mesh.corners for mesh in meshes])
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    nearest = np.full(len(directions), np.inf)
    for index, direction in enumerate(directions):
        p = np.cross(direction, edge2)
        det = np.einsum("ij,ij->i", edge1, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origin - corners[:, 0]
            u, q = np.einsum("ij,ij->i", s, p) / det, np.cross(s, edge1)
            v, t = q @ direction / det, np.einsum("ij,ij->i", edge2, q) / det
            met = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 1e-9)
        nearest[index] = t[met].min(initial=np.inf)
    return nearest


def rays(count: int) -> np.ndarray:
    directions = np.random.default_rng(5).normal(size=(count, 3))
    half = np.array([SIZE["width"] / 2, SIZE["depth"] / 2, SIZE["height"] / 2])
    edges = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if abs(x) + abs(y)
                      + abs(z) > 1])
    towards = (edges * half)[:, None] * (1 + 0.004 * np.random.default_rng(6).normal(size=(len(edges), 12, 3)))
    return np.concatenate([directions, edges * half, towards.reshape(-1, 3)])


def test_no_ray_leaves_a_room_without_windows() -> None:
    meshes = [asset.mesh for asset in room().values()]
    for origin in ((0.0, 0.0, 1.25), (1.6, -1.1, 0.4)):
        assert np.isfinite(hits(meshes, np.array(origin), rays(300))).all()


@pytest.mark.parametrize("windows", range(5))
def test_windows_open_one_wall_after_the_other(windows: int) -> None:
    walls = room(windows=windows)["walls"].mesh
    aside = np.array([0.31, 0.31, 0.0])
    for index, direction in enumerate(DIRECTIONS.values()):
        origin = np.where(np.array(direction) == 0, aside, 0)
        origin[2] = (SILL_HEIGHT + LINTEL_HEIGHT) / 2 - 0.1
        out = hits([walls], origin, np.array([direction], dtype=float))[0]
        assert np.isinf(out) == (index < windows)


@pytest.mark.parametrize(("size", "windows"), [((1.0, 1.0, 1.5), 4), ((4.0, 3.0, 2.5), 2), ((100.0, 30.0, 30.0), 4)])
def test_parts_are_closed_and_outside_the_interior(size: tuple[float, float, float], windows: int) -> None:
    width, depth, height = size
    made = make_room(width=width, depth=depth, height=height, ceiling=True, windows=windows, skirting=0.1, seed=0)
    for asset in made.values():
        mesh = asset.mesh
        edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
        there, back = (edges[:, i] * len(mesh.positions) + edges[:, 1 - i] for i in (0, 1))
        assert len(np.unique(there)) == len(there)
        np.testing.assert_array_equal(np.sort(there), np.sort(back))
        assert mesh.volume > 0
        assert np.isfinite(mesh.uvs).all()
        inner = np.abs(mesh.positions[:, :2]) < np.array([width, depth]) / 2 - 0.041
        inside = inner.all(axis=1) & (mesh.positions[:, 2] > 1e-6) & (mesh.positions[:, 2] < height - 1e-6)
        assert not inside.any()
    np.testing.assert_allclose(made["floor"].mesh.bounds[:, 2], (-THICKNESS, 0), atol=1e-12)
    np.testing.assert_allclose(made["ceiling"].mesh.bounds[:, 2], (height, height + THICKNESS))
    np.testing.assert_allclose(made["walls"].mesh.bounds[1, :2] * 2, (width + 2 * THICKNESS, depth + 2 * THICKNESS))


@pytest.mark.parametrize("windows", [1, 2, 3, 4])
def test_no_ray_leaves_a_room_but_through_a_pane(windows: int) -> None:
    sizes = {**SIZE, "skirting": 0.08, "windows": windows}
    panes = make_panes(**sizes)  # type: ignore[arg-type]
    shell = [asset.mesh for asset in room(windows=windows).values()]
    for origin in ((0.0, 0.0, 1.25), (1.6, -1.1, 0.4)):
        open_way = hits(shell, np.array(origin), rays(300))
        assert np.isinf(open_way).any()
        assert np.isfinite(hits([*shell, panes.mesh], np.array(origin), rays(300))).all()


def test_panes_are_thin_glass_that_faces_the_room() -> None:
    panes = make_panes(**SIZE, skirting=0.08, windows=4)  # type: ignore[arg-type]
    glass, = panes.materials
    assert glass.thin and glass.transmission == 1 and glass.roughness == 0
    assert len(panes.mesh.faces) == 8
    towards = -panes.mesh.corners.mean(axis=1) + (0, 0, SIZE["height"] / 2)
    inwards = np.einsum("ij,ij->i", panes.mesh.area_normals, towards)
    assert (inwards > 0).all()
    half = np.array([SIZE["width"], SIZE["depth"]]) / 2
    outside = np.abs(panes.mesh.positions[:, :2]) - half
    assert (outside.max(axis=1) > 0.03).all() and (outside.max(axis=1) < THICKNESS - 0.02).all()
    size = np.ptp(panes.mesh.uvs[:2].reshape(-1, 2), axis=0)
    np.testing.assert_allclose(size, np.ptp(panes.mesh.positions[:4][:, [0, 2]], axis=0))


def test_ceiling_and_skirting_are_left_out_on_demand() -> None:
    assert set(room()) == {"floor", "walls", "ceiling"}
    bare = room(ceiling=False, skirting=0.0)
    assert set(bare) == {"floor", "walls"}
    assert len(bare["walls"].materials) == 1
    assert len(room()["walls"].materials) == 2


def test_one_more_window_changes_no_material() -> None:
    one, two = room(windows=1), room(windows=2)
    for name in one:
        for a, b in zip(one[name].materials, two[name].materials, strict=True):
            assert a.name == b.name
            if a.texture is not None:
                np.testing.assert_array_equal(a.texture.base_color, b.texture.base_color)


@pytest.mark.parametrize("change", [{"width": 0.5}, {"windows": 5}, {"skirting": 2.0}, {"height": float("nan")}])
def test_sizes_that_make_no_room_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(UserError, match="room: expected"):
        room(**change)
