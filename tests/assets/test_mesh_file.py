"""Mesh files become assets: places, textures, units, and what is wrong with them."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import corner_normals, edges_of
from dataset_builder.geometry.rough_base import bounding_radius, displace, rough_base
from dataset_builder.seeding import rng
from dataset_builder.spec.mesh_source import MESH_SUFFIXES, companions
from tests.assets.gltf_files import COLORS, QUAD, load, png, texel_at, write_glb

ASSETS = Path(os.environ.get("THREEDF_ASSETS") or Path(__file__).parents[3] / "shared" / "assets")


@pytest.mark.parametrize(("up", "size"), [("x", (2, 3, 1)), ("y", (1, 3, 2)), ("z", (1, 2, 3))])
def test_up_and_scale(tmp_path, up, size):
    path = tmp_path / "tetra.obj"
    path.write_text("v 0 0 0\nv 10 0 0\nv 0 20 0\nv 0 0 30\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    mesh = load(path, up=up, scale=0.1).mesh
    np.testing.assert_allclose(mesh.bounds, [(-size[0] / 2, -size[1] / 2, 0), (size[0] / 2, size[1] / 2, size[2])])
    assert mesh.volume == pytest.approx(1)


def test_obj_with_its_materials(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                                    "usemtl shiny\nf 1/1 2/2 3/3\nusemtl plain\nf 1/1 3/3 4/4\n")
    (tmp_path / "a.mtl").write_text("newmtl shiny\nKd 0.001 0.5 1\nNs 6\nmap_Kd a.png\nnewmtl plain\nKd 1 0 0\n")
    (tmp_path / "a.png").write_bytes(png(COLORS))
    asset = load(tmp_path / "a.obj")
    by_name = {material.name: material for material in asset.materials}
    assert by_name["shiny"].base_color == (0.001, 0.5, 1.0)
    assert by_name["shiny"].roughness == pytest.approx(0.25**0.25)
    assert (by_name["plain"].base_color, by_name["plain"].roughness) == ((1.0, 0.0, 0.0), 0.8)
    assert by_name["plain"].texture is None and by_name["shiny"].metallic == 0
    names = [asset.materials[index].name for index in asset.mesh.material]
    assert sorted(names) == ["plain", "shiny"]
    lower_left = asset.mesh.uvs[names.index("shiny")][0]
    np.testing.assert_array_equal(texel_at(by_name["shiny"].texture, lower_left + 0.01), (0, 0, 1))
    assert len(asset.mesh.positions) == 4


def test_ply_colours_become_one_colour(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" \
           "property uchar red\nproperty uchar green\nproperty uchar blue\n" \
           "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0 0 0 255 0 128\n1 0 0 255 0 128\n0 1 0 255 0 128\n3 0 1 2\n")
    np.testing.assert_allclose(load(tmp_path / "a.ply").materials[0].base_color, (1, 0, 0.2158605), rtol=1e-5)


def test_meta_records_what_was_done(tmp_path):
    meta = load(write_glb(tmp_path / "quad.glb")).meta
    assert meta["licence"] == "CC0-1.0" and meta["source"] == "quad.glb"
    assert meta["moved"].startswith("-0.5 m, ")


def test_maps_lie_beside_their_library_whatever_their_options(tmp_path):
    folder = tmp_path / "mats"
    folder.mkdir()
    (tmp_path / "a.obj").write_text("mtllib mats/a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
                                    "usemtl m\nf 1/1 2/2 3/3\n")
    (folder / "a.mtl").write_text("newmtl m\nmap_Kd -s 1 1 1 -clamp on old oak.png\n")
    # The decoy is where the reader looks by itself
    (tmp_path / "old oak.png").write_bytes(png(np.zeros((3, 3, 3), np.uint8)))
    with pytest.raises(UserError, match=r"mats/a.mtl: map_Kd: expected an existing file, got old oak.png"):
        load(tmp_path / "a.obj")
    (folder / "old oak.png").write_bytes(png(COLORS))
    assert load(tmp_path / "a.obj").materials[0].texture.base_color.shape == (2, 2, 3)
    assert companions(tmp_path / "a.obj") == ("mats/a.mtl", "mats/old oak.png")


def test_every_missing_file_of_an_obj_is_named_at_once(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nmtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd oak.png\n")
    with pytest.raises(UserError) as caught:
        load(tmp_path / "a.obj")
    assert len(caught.value.problems) == 2
    assert "a.mtl: map_Kd: expected an existing file, got oak.png" in str(caught.value)
    assert "a.obj: mtllib: expected an existing file, got b.mtl" in str(caught.value)


def test_no_such_file_and_unsupported(tmp_path):
    with pytest.raises(UserError, match=r"none\.glb: expected an existing file, got none"):
        load(tmp_path / "none.glb")
    with pytest.raises(UserError, match=r"expected a mesh file \(.glb .gltf .obj .ply\), got .fbx"):
        load(tmp_path / "a.fbx")


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_every_format_is_read(tmp_path, suffix):
    written = trimesh.creation.box(extents=(1, 2, 4)).export(file_type=suffix[1:])
    for name, content in (written if isinstance(written, dict) else {f"model{suffix}": written}).items():
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
    asset = load(tmp_path / f"model{suffix}", up="z", scale=0.5)
    np.testing.assert_allclose(asset.mesh.bounds, [(-0.25, -0.5, 0), (0.25, 0.5, 2)])
    assert asset.mesh.volume == pytest.approx(1) and len(np.unique(asset.mesh.material)) == 1


@pytest.mark.parametrize("suffix", ["glb", "gltf", "ply"])
@pytest.mark.parametrize("content", [b"", b"nonsense", b"[1, 2]", b"glTF" + bytes(40), b"ply\nformat ascii 1.0\nelem"])
def test_unreadable_files(tmp_path, suffix, content):
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(content)
    with pytest.raises(UserError, match=f"a.{suffix}: expected"):
        load(path)


def test_empty_and_flat_meshes(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\n")
    with pytest.raises(UserError, match=r"a\.obj: expected"):
        load(tmp_path / "a.obj")
    flat = QUAD * np.array([1, 0, 0], dtype=np.float32)
    with pytest.raises(UserError, match=r"flat\.glb: mesh: expected at least one face with an area"):
        load(write_glb(tmp_path / "flat.glb", positions=flat))


def real_models():
    found = sorted(path for path in ASSETS.rglob("*") if path.suffix in (".gltf", ".obj")) if ASSETS.is_dir() else []
    return found or [None]


@pytest.mark.parametrize("path", real_models(), ids=lambda path: path.parent.name if path else "none")
def test_real_models_survive_the_whole_way(path):
    if path is None:
        pytest.skip("no real models: set THREEDF_ASSETS to a folder of .gltf and .obj files")
    asset = load(path, max_texture=64)
    assert asset.mesh.bounds[0, 2] == 0 and 0.1 < np.ptp(asset.mesh.bounds, axis=0).max() < 3
    np.testing.assert_allclose(asset.mesh.bounds.mean(axis=0)[:2], 0, atol=1e-9)
    assert all(material.texture is not None for material in asset.materials)
    base = rough_base(asset.mesh, edge_length=0.08, rounds=1, crease_angle=30)
    rough = displace(base.mesh, sigma=0.004, radius=bounding_radius(asset.mesh), direction="normal", rng=rng(0))
    np.testing.assert_allclose(np.ptp(base.mesh.bounds, axis=0), np.ptp(asset.mesh.bounds, axis=0), rtol=0.005)
    open_before, open_after = (edges_of(mesh.faces).face_count % 2 == 1 for mesh in (asset.mesh, rough))
    assert open_after.any() == open_before.any()
    np.testing.assert_allclose(np.linalg.norm(corner_normals(rough, creases=base.creases), axis=2), 1, rtol=1e-9)
