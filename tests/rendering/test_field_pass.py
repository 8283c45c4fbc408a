"""The pass through a field: where it is seen, how bright, and what its layers are."""

from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import FieldFile, write_field
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.planning.plan import plan_example
from dataset_builder.planning.scene.assets_of_plan import world_from_object
from dataset_builder.rendering.examples import Rendered, render_view
from dataset_builder.rendering.field_shelf import NO_SHELF, FieldShelf, tasks_of
from dataset_builder.rendering.pass_inputs import sky_radiance
from dataset_builder.spec.load import load_dataset

SIDE, SIZE = 48, 64
CENTRE, RADIUS = (0.1, 0.0, 0.2), 0.4
MIDDLE, BALL = np.array([0.25, 0.05, 0.25]), 0.12
"""A ball off the axis that the object is turned about."""
DENSE = 9.0
RECORD = FieldRecord(key="k", kind="density", truth=True, views=8, held_out=1, width=64, resolution=SIDE, psnr=30.0,
                     psnr_worst=29.0, ssim=0.9, opacity_iou=0.9, silhouette_iou=0.9, level=0.1, bodies=1,
                     bodies_dropped=0, depth_95=0.0, loss=0.1)
COLOUR = (0.8, 0.4, 0.2)


def field_of_a_ball(white: float = 1.0) -> FieldFile:
    """Dense inside of the ball and nothing outside, of one colour; its mesh is a pyramid inside of it."""
    axis = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    points = np.stack([x, y, z], axis=-1) * RADIUS + CENTRE
    grid = np.zeros((SIDE, SIDE, SIDE, 4), np.float32)
    grid[..., 0] = np.where(np.linalg.norm(points - MIDDLE, axis=-1) < BALL, DENSE, 0)
    grid[..., 1:] = np.log(np.expm1(4 * np.array(COLOUR))) / 4
    tip = MIDDLE + BALL / 2 * np.array([[1, 0, -1], [-1, 1, -1], [-1, -1, -1], [0, 0, 1]])
    mesh = TriangleMesh(positions=tip, faces=np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
                        uvs=np.zeros((4, 3, 2)), material=np.zeros(4), colors=np.full((4, 3, 4), [*COLOUR, 1.0]))
    return FieldFile(record=RECORD, mesh=mesh, centre=CENTRE, radius=RADIUS, white=white, grid=grid,
                     numbers={"scale": white})


LAYERS = (("i_s", "object"), ("mask_field", "object"), ("mask", "object"), ("s_prime", "object"),
          ("mask_rough", "object"))
Plan = Callable[..., ExamplePlan]


@pytest.fixture
def plan(small_spec: Path) -> Plan:
    """Plans an example of the small dataset with some layers, seen through a field or not."""

    def make(layers: tuple[tuple[str, str], ...] = LAYERS, seen: bool = True) -> ExamplePlan:
        whole = plan_example(load_dataset(small_spec), 1)
        render = whole.render.model_copy(update={"layers": layers, "width": SIZE, "height": SIZE})
        field = FieldPlan(kind="density", views=8, held_out=1, size=64, spp=4, resolution=SIDE, steps=10, seed="1",
                          light=whole.source_light) if seen else FieldPlan()
        effects = whole.effects.model_copy(update={"features": (*whole.effects.features, "colours")})
        return whole.model_copy(update={"render": render, "field": field, "effects": effects,
                                        "rough": whole.rough.model_copy(update={"field": field})})

    return make


@pytest.fixture
def shelf(tmp_path: Path, plan: Plan) -> FieldShelf:
    shelf, whole = FieldShelf(folder=tmp_path / "fields"), plan()
    task, = tasks_of(whole)
    write_field(shelf.path(task, Path()), field_of_a_ball(sky_radiance(whole)))
    return shelf


def rendered(plan: ExamplePlan, shelf: FieldShelf = NO_SHELF) -> Rendered:
    example, = render_view([plan], Path(), fields=shelf)
    return example


def test_a_ball_is_where_it_stands(plan: Plan, shelf: FieldShelf) -> None:
    whole = plan()
    example = rendered(whole, shelf)
    opacity, image = example.layers["mask_field"][..., 0], example.layers["i_s"]
    world = world_from_object(whole.target)
    camera = Pinhole.of(whole.camera, SIZE, SIZE)
    middle = world[:3, :3] @ MIDDLE + world[:3, 3]
    column, row, _ = camera.project(middle[None])[0]
    rows, columns = np.mgrid[:SIZE, :SIZE] + 0.5
    assert (opacity * columns).sum() / opacity.sum() == pytest.approx(column, abs=0.4)
    assert (opacity * rows).sum() / opacity.sum() == pytest.approx(row, abs=0.4)
    # The outline of a sphere: its half angle has the sine radius / distance
    away = np.linalg.norm(middle - camera.position)
    half = np.tan(np.arcsin(BALL / away)) * camera.focal
    assert np.sqrt(opacity.sum() / pi) == pytest.approx(half, rel=0.06)
    assert np.allclose(image[opacity > 0.999], sky_radiance(whole) * np.array(COLOUR), rtol=0.02)
    assert not image[opacity == 0].any() and opacity.min() == 0 and opacity.max() <= 1


def test_the_rough_mesh_is_the_fields_and_the_record_says_so(plan: Plan, shelf: FieldShelf) -> None:
    example = rendered(plan(), shelf)
    rough, seen = example.layers["mask_rough"][..., 0], example.layers["mask_field"][..., 0]
    assert 0 < rough.sum() < seen.sum() and not (rough[seen == 0]).any()
    assert example.layers["s_prime"][rough > 0.9].min() > 0
    assert example.record.field == (RECORD,)
    assert example.record.roughness_rms > 0


def test_a_field_that_was_not_made_is_named(plan: Plan, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="expected a field, found no file"):
        rendered(plan(), FieldShelf(folder=tmp_path))


def test_rendered_layers_stand_in_for_fields(plan: Plan) -> None:
    """Where i_s is rendered, mask_field is mask and i_s_clean is i_s, bit by bit."""
    layers = (("i_s", "object"), ("i_s_clean", "object"), ("mask", "object"), ("mask_field", "object"))
    example = rendered(plan(layers, seen=False))
    assert np.array_equal(example.layers["mask_field"], example.layers["mask"]) and example.layers["mask"].any()
    assert np.array_equal(example.layers["i_s_clean"], example.layers["i_s"]) and example.layers["i_s"].any()
    assert example.record.field == ()
