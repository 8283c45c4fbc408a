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
from dataset_builder.spec.mesh_source import FIELD_SUFFIX, MESH_SUFFIXES
from tests.assets.gltf_files import QUAD, load, write_glb

ASSETS = Path(os.environ.get("THREEDF_ASSETS") or Path(__file__).parents[3] / "shared" / "assets")


@pytest.mark.parametrize(("up", "size"), [("x", (2, 3, 1)), ("y", (1, 3, 2)), ("z", (1, 2, 3))])
def test_up_and_scale(tmp_path, up, size):
    path = tmp_path / "tetra.obj"
    path.write_text("v 0 0 0\nv 10 0 0\nv 0 20 0\nv 0 0 30\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    mesh = load(path, up=up, scale=0.1).mesh
    np.testing.assert_allclose(mesh.bounds, [(-size[0] / 2, -size[1] / 2, 0), (size[0] / 2, size[1] / 2, size[2])])
    assert mesh.volume == pytest.approx(1)


def test_meta_records_what_was_done(tmp_path):
    meta = load(write_glb(tmp_path / "quad.glb")).meta
    assert meta["licence"] == "CC0-1.0" and meta["source"] == "quad.glb"
    assert meta["moved"].startswith("-0.5 m, ")


@pytest.mark.parametrize("turned", ["f 4 3 2 1", "f 1 2 3 4"])
def test_a_sheet_lies_a_hair_above_the_floor(tmp_path, turned):
    (tmp_path / "rug.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 1 0 2\nv 0 0 2\n{turned}\n")
    rug = load(tmp_path / "rug.obj")
    np.testing.assert_allclose(rug.mesh.bounds[:, 2], 1e-4)
    assert "has faces in the plane of what it stands on: raised by 0.1 mm" in rug.meta["shape"]
    upright = load(tmp_path / "rug.obj", up="z")
    assert upright.mesh.bounds[0, 2] == 0 and "raised" not in upright.meta["shape"]


def test_no_such_file_and_unsupported(tmp_path):
    with pytest.raises(UserError, match=r"none\.glb: expected an existing file, got none"):
        load(tmp_path / "none.glb")
    with pytest.raises(UserError, match=r"got 'a.FBX': FBX is not read \(export glTF from Blender\)"):
        load(tmp_path / "a.FBX")
    with pytest.raises(UserError, match=r"expected a file that ends in one of .*, got 'a.jpg'"):
        load(tmp_path / "a.jpg")


@pytest.mark.parametrize("suffix", [suffix for suffix in MESH_SUFFIXES
                                    if not suffix.startswith(".usd") and suffix != FIELD_SUFFIX])
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
    assert asset.mesh.bounds[0, 2] in (0, 1e-4) and 0.1 < np.ptp(asset.mesh.bounds, axis=0).max() < 3
    np.testing.assert_allclose(asset.mesh.bounds.mean(axis=0)[:2], 0, atol=1e-9)
    assert all(material.texture is not None for material in asset.materials)
    base = rough_base(asset.mesh, edge_length=0.08, rounds=1, crease_angle=30)
    rough = displace(base.mesh, sigma=0.004, radius=bounding_radius(asset.mesh), direction="normal", rng=rng(0))
    np.testing.assert_allclose(np.ptp(base.mesh.bounds, axis=0), np.ptp(asset.mesh.bounds, axis=0), rtol=0.005)
    open_before, open_after = (edges_of(mesh.faces).face_count % 2 == 1 for mesh in (asset.mesh, rough))
    assert open_after.any() == open_before.any()
    np.testing.assert_allclose(np.linalg.norm(corner_normals(rough, creases=base.creases), axis=2), 1, rtol=1e-9)
