"""Things of a scene file as triangles: places that scale, shear and mirror."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.geometry.edges import corner_normals, unit
from dataset_builder.geometry.mesh import TriangleMesh, concatenate, transform
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.planning.scene.room_parts import RoomPart, room_parts
from dataset_builder.rendering.examples import Rendered, render_view
from dataset_builder.rendering.scene.triangle_soup import PARTS, clean, merge, part_soup
from dataset_builder.spec.load import load_dataset
from tests.gltf_scenes import CHAIR, DATASET, ROOM, WEDGE, WEDGE_FACES, at, thing, write_dataset

SHEARED = at(0.6, 0.1, 0, (0.9, 0.6, 0.7), -15) @ np.array([[1.0, 0.3, 0.1, 0], [0, 1, 0.2, 0], [0, 0, 1, 0],
                                                           [0, 0, 0, 1]])
MIRRORED = SHEARED @ np.diag([-1.0, 1, 1, 1])
PLACES = [at(1, 2, 3, yaw=70), at(0, 0, 0, (1, 2, 0.5)), SHEARED, MIRRORED, at(0, 0, 0, (-1, 1, 1), 20)]


def part(world: np.ndarray, seed: int = 0) -> RoomPart:
    """A tetrahedron with texture coordinates and colours of its own."""
    rng = np.random.default_rng(seed)
    mesh = TriangleMesh(positions=WEDGE, faces=WEDGE_FACES, uvs=rng.uniform(0, 1, (4, 3, 2)),
                        material=np.zeros(4, int), colors=rng.uniform(0, 1, (4, 3, 4)).astype(np.float32))
    asset = Asset(name="wedge", category="wedge", mesh=mesh, materials=(Material(name="m", base_color=(1, 1, 1)),))
    return RoomPart(name="wedge", part="furniture", asset=asset, instance=7, world=world)


@pytest.mark.parametrize("world", PLACES)
def test_a_placed_thing_is_its_mesh_moved_by_hand(world: np.ndarray) -> None:
    """Faces of a tetrahedron are flat, so that its normals are those of the moved faces, whatever the place."""
    made, moved = part_soup(part(world)), transform(part(world).asset.mesh, world)
    assert made.corners == pytest.approx(moved.corners)
    assert made.uvs == pytest.approx(moved.uvs) and made.colors == pytest.approx(moved.colors)
    assert made.normals == pytest.approx(np.repeat(unit(moved.area_normals)[:, None], 3, axis=1), abs=1e-7)
    assert set(made.instance) == {7}
    outward = np.einsum("ij,ij->i", made.normals[:, 0], made.corners.mean(axis=1) - made.corners.mean(axis=(0, 1)))
    assert (outward > 0).all()


def ball() -> tuple[np.ndarray, np.ndarray]:
    """Places and faces of a sphere."""
    from dataset_builder.rendering.scene.shapes import unit_sphere

    places, indices = np.unique(unit_sphere().reshape(-1, 3).round(9), axis=0, return_inverse=True)
    return places, indices.reshape(-1, 3)


def test_smooth_normals_stay_square_to_sheared_tangents() -> None:
    """n . t = 0 before is n' . A t = 0 after, by the inverse transpose: a sphere's normal is its position, and an
    ellipsoid's its gradient."""
    places, faces = ball()
    mesh = TriangleMesh(positions=places, faces=faces, uvs=np.zeros((len(faces), 3, 2)),
                        material=np.zeros(len(faces), int))
    asset = Asset(name="ball", category="ball", mesh=mesh, materials=(Material(name="m", base_color=(1, 1, 1)),))
    for world in PLACES:
        made = part_soup(RoomPart(name="ball", part="furniture", asset=asset, instance=3, world=world))
        inverse = np.linalg.inv(world[:3, :3])
        gradient = unit((made.corners - world[:3, 3]) @ inverse.T @ inverse)
        assert np.einsum("fci,fci->fc", made.normals, gradient).min() > 0.999


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_thing_has_one_set_of_normals_as_a_target_and_in_the_room(tmp_path: Path, mirror: float) -> None:
    """Of a ball so uneven that some of its edges become creases."""
    places, faces = ball()
    world = at(0, 0, 0.5) @ SHEARED @ np.diag([0.5 * mirror, 0.5, 0.06, 1.0])
    dataset = DATASET.replace('{name: "*"}, count: 2', "{name: Ball}, count: 1")
    path = write_dataset(tmp_path, [*ROOM, thing("Ball", world, positions=places, faces=faces)], dataset)
    plan = plan_example(load_dataset(path), 0)
    room = plan.room.model_copy(update={"scene": plan.room.scene.model_copy(update={"hidden": ()})})
    [around] = [part for part in room_parts(room, tmp_path) if part.name == "Ball"]
    one, other = clean(plan.target, tmp_path), part_soup(around)
    assert one.corners == pytest.approx(other.corners, abs=1e-6)
    assert one.normals == pytest.approx(other.normals, abs=1e-6)
    pairs = np.concatenate([other.corners, other.normals], axis=2).reshape(-1, 6).round(6)
    assert len(np.unique(pairs, axis=0)) > len(places)


def test_a_place_that_flattens_leaves_normals() -> None:
    made = part_soup(part(np.diag([1.0, 1.0, 0.0, 1.0])))
    assert np.linalg.norm(made.normals, axis=2) == pytest.approx(1)
    assert np.isfinite(made.normals).all()


def test_panes_belong_to_the_walls_of_a_room_in_code(tmp_path: Path) -> None:
    """As one mesh, to the last bit: they share no corner, and follow the walls' triangles and materials."""
    plan = RoomPlan(name="room", seed="5", width=4, depth=3, height=2.5, ceiling=True, glazing=True, windows=2,
                    skirting=0.08)
    floor, walls, panes, ceiling = room_parts(plan, tmp_path)
    assert [part.name for part in (floor, walls, panes, ceiling)] == ["floor", "walls", "walls", "ceiling"]
    assert [part.clear.all() for part in (floor, walls, panes, ceiling)] == [False, False, True, False]
    both = concatenate([walls.asset.mesh, panes.asset.mesh], material_offsets=[0, len(walls.asset.materials)])
    made = merge([part_soup(walls), part_soup(panes)])
    assert np.array_equal(made.corners, both.corners) and np.array_equal(made.material, both.material)
    assert np.array_equal(made.normals, corner_normals(both).astype(np.float32))
    assert np.array_equal(made.uvs, both.uvs.astype(np.float32))
    assert set(made.part) == {PARTS.index("walls")} and set(made.instance) == {2}


def render(plan: ExamplePlan, root: Path) -> Rendered:
    return next(iter(render_view([plan], root)))


@pytest.mark.parametrize("world", [SHEARED, MIRRORED], ids=["sheared", "mirrored"])
def test_a_mirrored_or_sheared_instance_looks_as_its_mesh_moved_by_hand(tmp_path: Path, world: np.ndarray) -> None:
    """Same samples: what differs is single precision at edges."""
    def planned(folder: Path, things: Sequence[Mapping[str, Any]]) -> ExamplePlan:
        folder.mkdir()
        dataset = DATASET.replace('{name: "*"}, count: 2', "{name: Chair_01}, count: 1").replace("spp: 8", "spp: 32")
        return plan_example(load_dataset(write_dataset(folder, things, dataset)), 0)

    moved = transform(TriangleMesh(positions=WEDGE, faces=WEDGE_FACES, uvs=np.zeros((4, 3, 2)),
                                   material=np.zeros(4, int)), world)
    placed = planned(tmp_path / "placed", [*ROOM, CHAIR, thing("Rock", world, positions=WEDGE, faces=WEDGE_FACES)])
    baked = planned(tmp_path / "baked", [*ROOM, CHAIR, thing("Rock", np.eye(4), positions=moved.positions,
                                                            faces=moved.faces)])
    # One camera and one light for both: planning looks at single precision, too
    baked = placed.model_copy(update={"room": baked.room, "target": baked.target})
    one, other = render(placed, tmp_path / "placed").layers, render(baked, tmp_path / "baked").layers
    assert (one["instance"] == 3).any()
    for name in ("i_s", "i_t", "depth", "instance"):
        apart = ~np.isclose(one[name], other[name], rtol=1e-3, atol=1e-4).all(axis=-1)
        assert apart.mean() < 0.01, name
