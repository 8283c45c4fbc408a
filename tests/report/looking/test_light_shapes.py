"""Lights as they are drawn: every kind, where it is and as large as it is."""

from typing import get_args

import numpy as np
import pytest

from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS, LightName
from dataset_builder.report.looking.light_shapes import LightShape, SymbolPlaces, light_shapes

STAGE = SymbolPlaces(np.array([0.0, 0.0, 0.5]), np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 2.5]))
AT = np.array([0.8, -0.4, 2.0])
DOWN = (0.6, 0.0, -0.8)


def drawn(kind: LightName, **keys: float) -> LightShape:
    """One light two metres up that shines down and aside."""
    light = LightPlan(kind=kind, position=tuple(AT), direction=DOWN, size=0.3, cutoff=30.0, radiance=(1, 1, 1),
                      temperature=0, weight=1, **keys)
    shape, = light_shapes(IlluminationPlan(lights=(light,), open=()), "target", STAGE)
    return shape


@pytest.mark.parametrize("kind", get_args(LightName))
def test_every_kind_is_drawn(kind: LightName) -> None:
    shape = drawn(kind, length=0.5 if LIGHT_KINDS[kind].long else 0.0)
    assert len(shape.faces) + len(shape.lines) > 0
    assert shape.faces.size == 0 or shape.faces.max() < len(shape.positions)
    assert np.isfinite(shape.positions).all()
    assert np.isfinite(shape.lines).all()
    if not LIGHT_KINDS[kind].outside:
        np.testing.assert_allclose(shape.at, AT)


def test_lights_are_called_by_their_names_or_else_by_their_places() -> None:
    plain = drawn("spot").light
    lights = (plain, plain.model_copy(update={"name": "key"}))
    shapes = light_shapes(IlluminationPlan(lights=lights, open=()), "target", STAGE)
    assert [shape.name for shape in shapes] == ["target 0: spot", "target key: spot"]


def area_of(shape: LightShape) -> float:
    """Of its faces, square metres."""
    a, b, c = (shape.positions[shape.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(("kind", "keys", "area"), [
    ("area", {}, 0.09), ("area", {"length": 0.5, "turn": 20.0}, 0.15), ("disk", {}, np.pi * 0.09),
    ("sphere", {}, 4 * np.pi * 0.09), ("cylinder", {"length": 0.5}, 2 * np.pi * 0.3 * 0.5),
])
def test_lamps_have_their_true_size(kind: LightName, keys: dict[str, float], area: float) -> None:
    shape = drawn(kind, **keys)
    # Round ones are polygons, which lie within
    assert area_of(shape) == pytest.approx(area, rel=1e-9 if kind == "area" else 0.03)
    np.testing.assert_allclose(shape.positions[np.unique(shape.faces)].mean(axis=0), AT, atol=1e-6)


def test_flat_lamps_face_where_they_shine() -> None:
    for kind in ("area", "disk"):
        np.testing.assert_allclose((drawn(kind).positions - AT) @ DOWN, 0, atol=1e-12)


def test_the_beam_of_a_spot_ends_beside_the_target_at_its_cutoff() -> None:
    shape = drawn("spot")
    along = (shape.lines[..., :].reshape(-1, 3) - AT) @ DOWN
    aside = np.linalg.norm(shape.lines.reshape(-1, 3) - AT, axis=1)
    ends = aside > 0
    np.testing.assert_allclose(np.degrees(np.arccos(along[ends] / aside[ends])), 30.0)
    assert along.max() == pytest.approx(float((STAGE.centre - AT) @ DOWN))


def test_the_sun_is_outside_and_points_at_the_target() -> None:
    shape = drawn("sun")
    assert ((shape.at < STAGE.low) | (shape.at > STAGE.high)).any()
    start, end = shape.lines[0]
    np.testing.assert_allclose(end, STAGE.centre)
    np.testing.assert_allclose((end - start) / np.linalg.norm(end - start), DOWN, atol=1e-12)
