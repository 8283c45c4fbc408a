"""What stands in an arrangement: where plans say, in the colours of its materials."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material, Texture
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import plan_example
from dataset_builder.planning.scene.assets_of_plan import asset_of, world_from_object
from dataset_builder.report.looking.shown_arrangement import shown_example
from dataset_builder.report.looking.standing import face_colours, standing
from dataset_builder.spec.load import load_dataset
from tests.small_specs import write_spec


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> ExamplePlan:
    """The first example of the small dataset."""
    return plan_example(load_dataset(write_spec(tmp_path_factory.mktemp("specs"))), 0)


def coloured(corners: list[list[float]], material: Material, colors: np.ndarray | None = None) -> list[int]:
    """The colour of a face with these corners in the texture."""
    mesh = TriangleMesh(positions=np.eye(3), faces=np.array([[0, 1, 2]]), uvs=np.array([corners]),
                        material=np.zeros(1), colors=colors)
    return face_colours(Asset(name="", category="", mesh=mesh, materials=(material,)))[0].tolist()


def test_a_face_has_the_colour_of_the_texture_amid_it() -> None:
    texels = np.zeros((2, 2, 3), np.float32)
    texels[0, 1] = (1, 0.5, 0)  # Row 0 is at v = 1
    material = Material(name="", base_color=(0.5, 1, 1), texture=Texture(base_color=texels))
    # sRGB of a half is 188 of 255
    assert coloured([[0.7, 0.7], [0.9, 0.7], [0.8, 0.9]], material) == [188, 188, 0]
    assert coloured([[0.1, 0.1], [0.3, 0.1], [0.2, 0.3]], material) == [0, 0, 0]
    # A face that spans it has the mean, an eighth of red and green each: 99
    assert coloured([[0, 0], [4, 0], [0, 4]], material) == [99, 99, 0]


def test_vertex_colours_multiply_and_light_of_its_own_shows() -> None:
    grey = Material(name="", base_color=(1, 1, 1))
    colors = np.full((1, 3, 4), 0.5, np.float32)
    assert coloured([[0, 0]] * 3, grey, colors) == [188, 188, 188]
    assert coloured([[0, 0]] * 3, Material(name="", base_color=(0, 0, 0), emission=(9, 0, 0))) == [255, 0, 0]


def test_things_stand_where_the_plan_has_them(plan: ExamplePlan) -> None:
    things = standing(plan.room, plan.target, plan.furniture, Path())
    assert [thing.part for thing in things] == ["target", "furniture", "floor", "walls", "ceiling"]
    for thing, placed in zip(things[:2], (plan.target, *plan.furniture), strict=True):
        mesh, world = asset_of(placed.object, Path()).mesh, world_from_object(placed)
        np.testing.assert_allclose(thing.positions, mesh.positions @ world[:3, :3].T + world[:3, 3])
        assert (thing.name, thing.category) == (placed.object.name, placed.object.category)


def test_an_example_is_shown_with_its_camera_and_lights(plan: ExamplePlan) -> None:
    shown = shown_example(plan, Path())
    assert shown.camera is not None
    np.testing.assert_allclose(shown.camera.position, plan.camera.position)
    assert [light.name for light in shown.lights] == [
        f"{of} {k}: {light.kind}" for of, lit in (("source", plan.source_light), ("target", plan.target_light))
        for k, light in enumerate(lit.lights)]
    lamp = next(light for light in shown.lights if light.of == "target" and not light.outside)
    np.testing.assert_allclose(lamp.at, lamp.light.position)
    assert shown.roof == pytest.approx(plan.room.height)
