"""Things whose pieces name different parts of a building: the pieces are things, whatever the format."""

from pathlib import Path

import pytest

from dataset_builder.assets.scene_model import SceneModel
from dataset_builder.label.scene_source import PartPatterns
from tests.assets.gltf_files import GltfMaker
from tests.assets.gltf_scenes import add_mesh, box_asset, load, scene
from tests.assets.scene_readers.usd_stages import METRES, mesh, prim
from tests.assets.scene_readers.usd_stages import scene as usd_scene

COMPONENT = 'kind = "component"'
SHELL = {"Floor": ((0, 0, -0.1), (4, 3, 0)), "WallNorth": ((0, 3, 0), (4, 3.1, 2.5)),
         "Ceiling": ((0, 0, 2.5), (4, 3, 2.6)), "Ornament": ((1, 1, 0), (1.2, 1.2, 0.3))}
ROLES = {"Floor": "floor", "WallNorth": "walls", "Ceiling": "ceiling", "Ornament": "object"}
Corners = tuple[tuple[float, ...], tuple[float, ...]]


def roles(model: SceneModel) -> dict[str, str]:
    return {thing.name: thing.role for thing in model.things}


def joined(name: str) -> tuple[PartPatterns, ...]:
    return (PartPatterns(part="object", patterns=(name,)),)


def cube(name: str, corners: Corners) -> str:
    """A box as a Cube of its own size and place."""
    low, high = corners
    size, middle = (tuple(b - a for a, b in zip(low, high, strict=True)),
                    tuple((a + b) / 2 for a, b in zip(low, high, strict=True)))
    return prim("Cube", name, "double size = 1", f"double3 xformOp:translate = {middle}",
                f"float3 xformOp:scale = {size}",
                'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]')


def stage(*inner: str, name: str = "Building", metadata: str = "") -> str:
    return METRES + prim("Xform", "World", prim("Xform", name, *inner, metadata=metadata),
                         prim("Xform", "Chair", mesh("seat")))


@pytest.mark.parametrize("metadata", ["", COMPONENT])
def test_shapes_of_an_xform_of_a_stage(metadata: str, tmp_path: Path) -> None:
    text = stage(*(cube(name, box) for name, box in SHELL.items()), metadata=metadata)
    expected = {f"/World/Building/{name}": role for name, role in ROLES.items()} | {"/World/Chair": "object"}
    assert roles(usd_scene(tmp_path, text)) == expected
    assert roles(usd_scene(tmp_path, text, parts=joined("/World/Building"))) == {
        "/World/Building": "object", "/World/Chair": "object"}


def test_what_else_is_in_a_component_falls_to_its_xforms(tmp_path: Path) -> None:
    rooms = prim("Xform", "Upstairs", cube("Floor", SHELL["Floor"]), cube("Wall", SHELL["WallNorth"]))
    table = prim("Xform", "Table", mesh("top"), mesh("leg", points="(0,0,0), (1,0,0), (1,0,1), (0,0,1)"))
    model = usd_scene(tmp_path, stage(rooms, table, cube("Roof", SHELL["Ceiling"]), metadata=COMPONENT))
    assert roles(model) == {"/World/Building/Upstairs/Floor": "floor", "/World/Building/Upstairs/Wall": "walls",
                            "/World/Building/Table": "object", "/World/Building/Roof": "ceiling",
                            "/World/Chair": "object"}


@pytest.mark.parametrize(("name", "pieces"), [
    # Furniture, parts of one kind, and names that say nothing
    ("Dollhouse", ("Floor", "Wall", "Roof")), ("Block", ("Wall_1", "Wall_2")), ("Block", ("Wall_1", "b")),
    ("Block", ("floor_lamp", "wall_art"))])
def test_what_stays_one_thing(name: str, pieces: tuple[str, ...], tmp_path: Path) -> None:
    inner = [cube(each, ((k, 0, 0), (k + 1, 1, 1))) for k, each in enumerate(pieces)]
    assert list(roles(usd_scene(tmp_path, stage(*inner, name=name)))) == [f"/World/{name}", "/World/Chair"]


def test_nodes_of_gltf(tmp_path: Path) -> None:
    made = GltfMaker()
    made.add("nodes", name="Building", children=[1, 2, 3, 4])
    for name, (low, high) in SHELL.items():
        made.add("nodes", name=name, mesh=add_mesh(made, box_asset(low, high)))
    made.add("nodes", name="Chair", mesh=add_mesh(made, box_asset((2, 1, 0), (2.5, 1.5, 0.9))))
    assert roles(scene(made, tmp_path)) == {f"Building/{name}": role for name, role in ROLES.items()} | {
        "Chair": "object"}
    assert roles(scene(made, tmp_path, parts=joined("Building"))) == {"Building": "object", "Chair": "object"}


def test_groups_of_an_object_of_obj(tmp_path: Path) -> None:
    lines, first = ["o Building"], 1
    for name, (low, high) in [*SHELL.items(), ("Chair", ((2, 1, 0), (2.5, 1.5, 0.9)))]:
        lines.append(f"o {name}" if name == "Chair" else f"g {name}")
        box = box_asset(low, high).mesh
        lines += [f"v {x} {z} {-y}" for x, y, z in box.positions.tolist()]
        lines += [" ".join(map(str, ("f", *face))) for face in (box.faces + first).tolist()]
        first += len(box.positions)
    (tmp_path / "a.obj").write_text("\n".join([*lines, "g seat", f"f {first - 8} {first - 7} {first - 4}"]))
    found = load(tmp_path / "a.obj")
    assert roles(found) == {f"Building/{name}": role for name, role in ROLES.items()} | {"Chair": "object"}
    assert all(len(thing.asset.mesh.faces) == 12 for thing in found.things[:4])
    assert roles(load(tmp_path / "a.obj", parts=joined("Building"))) == {"Building": "object", "Chair": "object"}
