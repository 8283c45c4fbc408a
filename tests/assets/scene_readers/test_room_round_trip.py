"""A procedural room with furniture, written as glTF, comes back: triangles, materials, places, parts."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.procedural.furniture import make_furniture
from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.assets.scene_model import SceneModel
from dataset_builder.geometry.mesh import TriangleMesh, concatenate, transform
from dataset_builder.spec.families import FAMILIES
from tests.assets.gltf_files import GltfMaker
from tests.assets.gltf_scenes import add_mesh, matrix, names, placed, plain, scene, world_corners

TURN = [[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]
CHAIRS = {"Chair_01": placed(1, 0.5, linear=TURN), "Chair_02": placed(-1, 0.2, linear=np.diag([-1.1, 1, 0.9]))}
"""The second one is a mirror image."""


def room_of() -> dict[str, Asset]:
    made = make_room(width=4, depth=3.5, height=2.6, ceiling=True, windows=2, skirting=0.08, seed=3)
    return {name: plain(asset) for name, asset in made.items()}


def chair_of() -> Asset:
    params = {param.name: param.low for param in FAMILIES["chair"].params}
    return plain(make_furniture(family="chair", params=params, seed=1, name="chair"))


def furnished(folder: Path, room: dict[str, Asset], chair: Asset) -> SceneModel:
    """The parts of the room and two chairs that share a mesh, all below a node `Room`."""
    made = GltfMaker()
    nodes = [made.add("nodes", name=name, mesh=add_mesh(made, asset)) for name, asset in room.items()]
    shared = add_mesh(made, chair)
    nodes += [made.add("nodes", name=name, mesh=shared, matrix=matrix(world)) for name, world in CHAIRS.items()]
    made.add("nodes", name="Room", children=nodes)
    return scene(made, folder)


def as_set(corners: np.ndarray) -> np.ndarray:
    """(F, 9) faces in an order of their own, each from its least corner on."""
    rounded = np.round(corners, 4) + 0.0
    first = np.array([min(range(3), key=lambda k: tuple(face[k])) for face in rounded])
    turned = rounded[np.arange(len(corners))[:, None], (first[:, None] + np.arange(3)) % 3].reshape(-1, 9)
    return turned[np.lexsort(turned.T)]


@pytest.fixture(scope="module")
def room() -> dict[str, Asset]:
    return room_of()


@pytest.fixture(scope="module")
def chair() -> Asset:
    return chair_of()


@pytest.fixture(scope="module")
def found(room: dict[str, Asset], chair: Asset, tmp_path_factory: pytest.TempPathFactory) -> SceneModel:
    return furnished(tmp_path_factory.mktemp("room"), room, chair)


def test_names_and_parts_of_the_building(found: SceneModel) -> None:
    assert [(thing.name, thing.role, thing.category) for thing in found.things] == [
        ("Room/floor", "floor", "floor"), ("Room/walls", "walls", "wall"), ("Room/ceiling", "ceiling", "ceiling"),
        ("Room/Chair_01", "object", "chair"), ("Room/Chair_02", "object", "chair")]
    assert found.faults == () and found.contains.startswith("5 things, 0 lights, 0 cameras, 4 meshes")


def test_the_same_triangles(found: SceneModel, room: dict[str, Asset], chair: Asset) -> None:
    meshes = [*(asset.mesh for asset in room.values()), *(transform(chair.mesh, world) for world in CHAIRS.values())]
    written = concatenate([TriangleMesh(positions=mesh.positions, faces=mesh.faces, uvs=mesh.uvs,
                                        material=mesh.material) for mesh in meshes])
    np.testing.assert_allclose(as_set(world_corners(found.things)), as_set(written.corners), atol=2e-4)


def test_the_same_materials(found: SceneModel, room: dict[str, Asset], chair: Asset) -> None:
    for thing, asset in zip(found.things, [*room.values(), chair, chair], strict=True):
        written = [asset.materials[index] for index in np.unique(asset.mesh.material)]
        for read, own in zip(thing.asset.materials, written, strict=True):
            assert read.name.startswith(own.name)
            assert (read.roughness, read.metallic, read.specular) == (own.roughness, own.metallic, own.specular)
            assert read.base_color == own.base_color and read.texture is None


def test_instances_of_a_mesh_share_an_asset_and_keep_their_matrices(found: SceneModel) -> None:
    first, second = found.things[-2:]
    assert first.asset is second.asset and first.content == second.content
    for thing, world in zip((first, second), CHAIRS.values(), strict=True):
        np.testing.assert_allclose(thing.world, world, atol=1e-6)


def test_equal_things_of_different_scenes_have_one_content(found: SceneModel, chair: Asset, tmp_path: Path) -> None:
    made = GltfMaker()
    made.add("nodes", name="seat", mesh=add_mesh(made, chair))
    other = scene(made, tmp_path).things[0]
    assert other.content == found.things[-1].content
    assert other.content not in {thing.content for thing in found.things[:-2]}


def test_a_room_of_one_mesh_is_parted(room: dict[str, Asset], chair: Asset, tmp_path: Path) -> None:
    """No name says what is floor, wall, or ceiling: how faces lie does."""
    made = GltfMaker()
    whole = concatenate([asset.mesh for asset in room.values()], material_offsets=[0, 10, 20])
    one = Asset(name="all", category="", mesh=TriangleMesh(
        positions=whole.positions, faces=whole.faces, uvs=whole.uvs, material=np.zeros(len(whole.faces))),
        materials=room["floor"].materials[:1])
    made.add("nodes", name="Mesh_7", mesh=add_mesh(made, one))
    shared = add_mesh(made, chair)
    for name, world in CHAIRS.items():
        made.add("nodes", name=name, mesh=shared, matrix=matrix(world))
    found = scene(made, tmp_path)
    assert [(thing.name, thing.role) for thing in found.things[:3]] == [
        ("Mesh_7#floor", "floor"), ("Mesh_7#walls", "walls"), ("Mesh_7#ceiling", "ceiling")]
    assert sum(len(thing.asset.mesh.faces) for thing in found.things[:3]) == len(whole.faces)
    floor, _, ceiling = (world_corners([thing])[..., 2] for thing in found.things[:3])
    assert floor.max() < 0.01 and ceiling.min() > 2.59
    inside = [np.linalg.norm(thing.asset.mesh.area_normals, axis=1).sum() / 2 for thing in found.things[:3]]
    assert inside[0] > 4 * 3.5 and inside[2] > 4 * 3.5
    assert any("Mesh_7 is the building in one mesh" in note for note in found.left_out)
    kept = scene(made, tmp_path, parts=[{"part": "object", "patterns": ["Mesh_7"]}])
    assert names(kept, "object") == ["Mesh_7", "Chair_01", "Chair_02"]
