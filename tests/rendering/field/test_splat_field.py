"""Splats become the field of an object: cropped, upright, to scale, on the ground, with a mesh where they are."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.assets.field_file import FieldFile, encode
from dataset_builder.assets.linear_texels import linear_from_srgb
from dataset_builder.errors import UserError
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_crop import cropped, main_body
from dataset_builder.geometry.splat_moves import chosen, joined, moved
from dataset_builder.geometry.turns import upright
from dataset_builder.rendering.field.seen import look_of
from dataset_builder.rendering.field.splat_field import SplatStance, field_of_splats
from tests.assets.splat_files import ball, box, random_cloud

CELLS, VIEWS = 40, 24
UP = SplatStance(up=(0, 0, 1))


def made(cloud: SplatCloud, stance: SplatStance = UP, **how: float) -> FieldFile:
    return field_of_splats(cloud, stance, key="k", cells=CELLS, views=VIEWS, **how)


def shifted(cloud: SplatCloud, *offset: float, scale: float = 1.0) -> SplatCloud:
    matrix = scale * np.eye(4)
    matrix[:, 3] = *offset, 1
    return moved(cloud, matrix)


@pytest.fixture(scope="module")
def ball_field() -> FieldFile:
    return made(ball(4000, gloss=0.0))


def test_the_mesh_of_a_ball_is_that_ball(ball_field: FieldFile) -> None:
    """Within a quarter of a cell on average, the depth being that of the middles of splats."""
    mesh = ball_field.mesh
    cell = 2 * 1.4 / CELLS
    assert np.allclose(mesh.bounds.mean(axis=0)[:2], 0, atol=1e-9) and mesh.bounds[0, 2] == pytest.approx(0, abs=1e-9)
    middle = np.array([0, 0, mesh.bounds[1, 2] / 2])
    off = np.linalg.norm(mesh.positions - middle, axis=1) - 1
    assert abs(off.mean()) < 0.25 * cell and np.quantile(np.abs(off), 0.95) < 0.6 * cell
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.06)
    assert ball_field.record.bodies == 1 and ball_field.record.silhouette_iou > 0.95


def test_colours_are_what_the_splats_show(ball_field: FieldFile) -> None:
    mesh = ball_field.mesh
    assert mesh.colors is not None
    corners = mesh.corners.reshape(-1, 3) - [0, 0, mesh.bounds[1, 2] / 2]
    expected = linear_from_srgb(0.5 + 0.3 * np.sin(4 * corners / np.linalg.norm(corners, axis=1, keepdims=True)))
    assert np.abs(mesh.colors[..., :3].reshape(-1, 3) - expected).mean() < 0.02


def test_the_record_claims_no_figures_of_a_fit(ball_field: FieldFile) -> None:
    record = ball_field.record
    assert (record.kind, record.truth, record.views, record.held_out, record.psnr, record.opacity_iou) == (
        "splats", False, 0, 0, 0, 0)
    assert encode(ball_field) == encode(made(ball(4000, gloss=0.0)))


def test_the_ball_of_a_field_holds_its_splats(ball_field: FieldFile) -> None:
    assert ball_field.splats is not None
    reach = np.linalg.norm(ball_field.splats.centres - np.array(ball_field.centre), axis=1)
    assert (reach + 2.9 * ball_field.splats.scales.max(axis=1)).max() < ball_field.radius
    assert callable(look_of(ball_field))


def test_a_box_stands_as_is_asked() -> None:
    """0.6 wide, 1.6 high along -Y and 1 deep, turned by a quarter and 0.8 m high; splats stick out at its edges."""
    lying = moved(box(24, (0.3, 0.5, 0.8)), np.array([[1, 0, 0, 5], [0, 0, -1, 2], [0, 1, 0, 1], [0, 0, 0, 1.0]]))
    field = made(lying, SplatStance(up=(0, -1, 0), yaw=90, height=0.8))
    assert np.allclose(field.mesh.size, (0.55, 0.37, 0.8), atol=0.03) and field.mesh.size[2] == pytest.approx(0.8)
    assert field.splats is not None
    extent = np.ptp(field.splats.centres, axis=0)
    assert np.allclose(extent / extent[2], (0.625, 0.375, 1), atol=1e-3)
    assert np.allclose(field.splats.centres.mean(axis=0)[:2], 0, atol=0.01)


def test_a_scale_is_metres_to_a_unit() -> None:
    field = made(box(12, (0.3, 0.5, 0.8), degree=0), SplatStance(up=(0, 0, 1), scale=2.0))
    assert field.splats is not None and np.allclose(np.ptp(field.splats.centres, axis=0), (1.2, 2, 3.2), atol=1e-3)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -2), (0, 3, 0), (0, -1, 0), (1, 0, 0), (0.3, -0.5, 0.8)])
def test_up_is_turned_up(up: tuple[float, float, float]) -> None:
    turn = upright(up, 30)[:3, :3]
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-12) and np.linalg.det(turn) == pytest.approx(1)
    assert np.allclose(turn @ up / np.linalg.norm(up), (0, 0, 1), atol=1e-12)


def test_y_up_is_turned_as_mesh_files_are() -> None:
    assert np.allclose(upright((0, 1, 0), 0)[:3, :3], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)


def test_what_floats_about_is_left_out() -> None:
    scene = joined([ball(2000), shifted(ball(60), 6, 0, 0, scale=0.2), shifted(random_cloud(3), 0, 9, 0)])
    assert len(main_body(scene)) == 2000
    assert len(cropped(scene, ball=np.array([6, 0, 0, 0.5]))) == 60
    assert len(cropped(scene, box=np.array([[-2, -2, -2], [2, 2, 0]]))) == 1000
    with pytest.raises(UserError, match="got none of 2,063, whose middles lie between"):
        cropped(scene, ball=np.array([0, 0, 50, 1]))


def test_a_body_is_whole_however_it_is_sampled() -> None:
    draws = np.random.default_rng(0)
    sparse = chosen(ball(4000), draws.permutation(4000)[:1000])
    assert len(main_body(sparse)) == 1000 and len(main_body(ball(1, degree=0))) == 1


@pytest.mark.parametrize(("stance", "told"), [
    (SplatStance(up=(0, 0, 0)), "up: expected a direction"),
    (SplatStance(up=(0, 0, 1), height=1, scale=1), "expected a height or a scale, got both"),
    (SplatStance(up=(0, 0, 1), height=0), "above 0, got 0"), (SplatStance(up=(0, 0, 1), scale=-1), "above 0, got -1"),
    (SplatStance(up=(0, 0, 1), ball=(9, 9, 9, 1)), "crop: expected it to hold splats")])
def test_wrong_stances_are_told(stance: SplatStance, told: str) -> None:
    with pytest.raises(UserError, match=told):
        field_of_splats(ball(500), stance, key="k", cells=16, views=8)


def test_what_is_transparent_has_no_surface() -> None:
    faint = replace(ball(500), opacities=np.full(500, 0.02, np.float32))
    with pytest.raises(UserError, match="expected a surface that blocks half of the light"):
        made(faint)


@pytest.mark.parametrize("spoilt", [lambda cloud: replace(cloud, scales=np.exp(cloud.scales)),
                                    lambda cloud: replace(cloud, centres=np.zeros_like(cloud.centres))])
def test_splats_as_large_as_the_whole_are_told_at_once(spoilt: Callable[[SplatCloud], SplatCloud]) -> None:
    """Scales that were taken for logarithms, and splats in one place: every ray would meet all of them."""
    with pytest.raises(UserError, match="to be small beside the whole"):
        field_of_splats(spoilt(ball(2000)), SplatStance(up=(0, 0, 1)), key="k", cells=16, views=8)
