"""Fields as mesh files: nothing of them moves, faces stay as they look, and what has no mesh says what to do."""

import json
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import read_field, write_field
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import transform
from dataset_builder.geometry.repair import repair
from tests.assets.gltf_files import load
from tests.small_fields import ball, coloured, field_of, room, write_ball

IMPORT = r"\(make an object of its splats: `dataset-builder import capture FILE`\)"


def test_the_mesh_of_a_field_is_where_the_field_is(tmp_path: Path) -> None:
    path = write_ball(tmp_path / "a.npz")
    asset, written = load(path), read_field(path).mesh
    assert sorted(map(tuple, asset.mesh.positions)) == sorted(map(tuple, written.positions))
    assert np.array_equal(asset.mesh.corners, written.corners) and np.array_equal(asset.mesh.colors, written.colors)
    assert asset.meta["moved"] == "0 m, 0 m, 0 m" and "radiance in the light of its images" in asset.meta["left_out"]
    material, = asset.materials
    assert (material.base_color, material.specular, material.metallic) == ((1.0, 1.0, 1.0), 0.0, 0.0)


@pytest.mark.parametrize("moved", [(0.01, 0, 0), (0, -0.02, 0), (0, 0, 0.003), (0, 0, -0.003)])
def test_a_field_that_would_have_to_be_moved_is_refused(tmp_path: Path, moved: tuple[float, float, float]) -> None:
    path = write_ball(tmp_path / "a.npz", moved=moved)
    off = next(f"{step:g}" for step in moved if step)
    told = rf"stands on z = 0 over the origin, got one that is off by .*{off}.* m \(scale, turn"
    with pytest.raises(UserError, match=told):
        load(path)


def test_rounding_is_no_reason_to_refuse(tmp_path: Path) -> None:
    asset = load(write_ball(tmp_path / "a.npz", moved=(2e-7, 0, -2e-7)))
    assert asset.mesh.bounds[0, 2] == pytest.approx(-2e-7, abs=1e-12)


def test_a_field_with_a_flat_bottom_is_not_raised(tmp_path: Path) -> None:
    """Captures are pressed flat at the ground: an open mesh with faces in z = 0, as a rug has, stays there too."""
    mesh = ball()
    flat = np.maximum(mesh.positions, [-1, -1, 0.1]) - np.array([0, 0, 0.1])
    write_field(tmp_path / "a.npz", field_of(coloured(flat, mesh.faces[1:])))
    assert load(tmp_path / "a.npz").mesh.bounds[0, 2] == 0


@pytest.mark.parametrize("asked", [{"scale": 2.0}, {"up": "z"}])
def test_a_field_is_neither_scaled_nor_turned(tmp_path: Path, asked: dict[str, object]) -> None:
    with pytest.raises(UserError, match="expected scale 1 and up y of a field, which has metres"):
        load(write_ball(tmp_path / "a.npz"), **asked)


def test_a_field_without_a_mesh_is_refused(tmp_path: Path) -> None:
    mesh = ball()
    empty = type(mesh)(positions=np.zeros((0, 3)), faces=np.zeros((0, 3), np.int64), uvs=np.zeros((0, 3, 2)),
                       material=np.zeros(0, np.int64))
    write_field(tmp_path / "a.npz", type(field_of(mesh))(record=field_of(mesh).record, mesh=empty,
                                                         centre=(0, 0, 0), radius=1))
    with pytest.raises(UserError, match=r"a\.npz: expected triangles, got a file without any"):
        load(tmp_path / "a.npz")


def test_closed_pieces_are_turned_outwards_unless_they_are_known_to_look_inwards() -> None:
    inside = transform(ball(), np.diag([1.0, 1.0, -1.0, 1.0]))
    outwards, inwards = ball().volume, -ball().volume
    flipped = type(inside)(positions=inside.positions, faces=ball().faces, uvs=inside.uvs, material=inside.material)
    assert flipped.volume == pytest.approx(inwards)
    assert repair(flipped)[0].volume == pytest.approx(outwards)
    kept, report = repair(flipped, outwards=False)
    assert kept.volume == pytest.approx(inwards) and report.inside_out == 0
    assert room().volume < 0


def test_splats_say_how_they_become_an_object(tmp_path: Path) -> None:
    columns = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
               "rot_1", "rot_2", "rot_3"]
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n" + "".join(
        f"property float {name}\n" for name in columns) + "end_header\n"
    (tmp_path / "a.ply").write_bytes(header.encode() + np.zeros((3, len(columns)), "<f4").tobytes())
    with pytest.raises(UserError, match="got a cloud of 3 Gaussian splats " + IMPORT):
        load(tmp_path / "a.ply")
    (tmp_path / "a.spz").write_bytes(b"")
    with pytest.raises(UserError, match="expected a mesh or a field, got 'a.spz': SPZ holds Gaussian splats " + IMPORT):
        load(tmp_path / "a.spz")
    gltf = {"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_gaussian_splatting"],
            "meshes": [{"primitives": [{"mode": 0, "attributes": {"POSITION": 0},
                                        "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse"}}}]}],
            "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0,
            "accessors": [{"componentType": 5126, "count": 1, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0]}]}
    (tmp_path / "a.gltf").write_text(json.dumps(gltf))
    with pytest.raises(UserError, match="expected triangles, got a file without any " + IMPORT):
        load(tmp_path / "a.gltf")
    (tmp_path / "b.gltf").write_text(json.dumps(gltf | {"extensionsRequired": ["KHR_gaussian_splatting"]}))
    with pytest.raises(UserError, match="got a need of KHR_gaussian_splatting " + IMPORT):
        load(tmp_path / "b.gltf")
    (tmp_path / "a.usda").write_text('#usda 1.0\ndef ParticleField3DGaussianSplat "a"\n{\n}\n')
    with pytest.raises(UserError, match="got ParticleField3DGaussianSplat " + IMPORT):
        load(tmp_path / "a.usda")
