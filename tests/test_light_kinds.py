"""The table of light kinds: every consumer knows every row, and a row that one of them lacks is an error there."""

from typing import Any, get_args

import numpy as np
import pytest

from dataset_builder.assets.asset import Material
from dataset_builder.label.scene_plan import FogPlan, LightPlan, RoomPlan
from dataset_builder.light_kinds import LENGTHS, LIGHT_KINDS, LampName, LightKind, LightName, Quantity
from dataset_builder.planning.effects.caustics_told import told
from dataset_builder.planning.effects.materials_used import MaterialUse
from dataset_builder.planning.effects.reach import reach
from dataset_builder.planning.effects.transport_choice import PassLight
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.view.emission import direct_irradiance, facing_irradiance
from dataset_builder.rendering.backend import activate
from dataset_builder.report.spec_help import export_schema
from dataset_builder.spec.light import TargetSpec
from tests.small_scenes import light, lit_by

KINDS = tuple(LIGHT_KINDS.values())
LAMPS = tuple(kind for kind in KINDS if not kind.outside and kind.spare)
CLOSED = RoomPlan(name="room", seed="0", width=4, depth=3, height=2.5, ceiling=True, windows=0, skirting=0)


@pytest.fixture(scope="module")
def backend() -> str:
    """The LLVM backend, chosen before Mitsuba is imported."""
    return activate("llvm")


@pytest.fixture
def forgotten(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A kind that stands in the table alone, and a light of it."""
    monkeypatch.setitem(LIGHT_KINDS, "ring", LightKind(name="ring", quantity="radiance", sized=True))  # type: ignore
    return light("sphere").model_copy(update={"kind": "ring"})


def test_table_and_names_agree() -> None:
    assert tuple(LIGHT_KINDS) == get_args(LightName) and all(name == kind.name for name, kind in LIGHT_KINDS.items())
    assert set(get_args(LampName)) == {kind.name for kind in LAMPS} == {kind.name for kind in KINDS
                                                                        if kind.spare and not kind.outside}
    assert set(LENGTHS) == set(get_args(Quantity)) == {kind.quantity for kind in KINDS}


def test_specs_and_schema_take_every_lamp_and_no_other() -> None:
    assert TargetSpec.model_validate({"kinds": [kind.name for kind in LAMPS]})
    shown = export_schema()["dataset"]["$defs"]["TargetSpec"]["properties"]["kinds"]["items"]["enum"]
    assert set(shown) == {kind.name for kind in LAMPS}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_labels_take_and_explain_every_kind(kind: LightKind) -> None:
    assert f"{kind.name}: " in (LightPlan.__doc__ or "")
    assert LightPlan.model_validate(light(kind.name).model_dump()).kind == kind.name


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_facing_irradiance_follows_the_quantity(kind: LightKind) -> None:
    """Twice as far from a light twice the size it is the same, but for an intensity, which holds a squared length."""
    near, far = facing_irradiance(kind.name, 0.2, 1.5, 0.7), facing_irradiance(kind.name, 0.4, 3.0, 1.4)
    assert near > 0 and near / far == pytest.approx(2 ** LENGTHS[kind.quantity])
    assert (facing_irradiance(kind.name, 0.2, 1.5, 1) != facing_irradiance(kind.name, 0.1, 1.5, 1)) == kind.sized
    assert (facing_irradiance(kind.name, 0.2, 1.5, 1) == facing_irradiance(kind.name, 0.2, 9, 1)) == kind.outside
    assert (facing_irradiance(kind.name, 0.2, 1.5) == 0) == kind.long


@pytest.mark.parametrize("kind", [kind for kind in KINDS if not kind.all_round and not kind.long],
                         ids=lambda kind: kind.name)
def test_direct_irradiance_depends_on_the_direction_of_what_is_aimed(kind: LightKind) -> None:
    points, normals = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    down, up = (direct_irradiance(light(kind.name, direction=(0, 0, z)), points, normals) for z in (-1, 1))
    assert down[0] == pytest.approx(facing_irradiance(kind.name, 0.3, 3.0) * np.ones(3))
    assert up.any() != kind.aimed


def test_a_cylinder_shines_aside_and_not_along_its_axis() -> None:
    points, normals = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    aside, along = (direct_irradiance(light("cylinder", direction=axis, length=1.2), points, normals)[0]
                    for axis in ((0, 1, 0), (0, 0, 1)))
    assert aside == pytest.approx(facing_irradiance("cylinder", 0.3, 3.0, 1.2) * np.ones(3)) and not along.any()


def test_a_sky_has_no_direct_irradiance() -> None:
    with pytest.raises(KeyError):
        direct_irradiance(light("dome"), np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_frames_scale_what_holds_lengths(kind: LightKind) -> None:
    from dataset_builder.rendering.scene.local_frame import LocalFrame

    lamp = light(kind.name, radiance=(3.0, 2.0, 1.0), size=0.5)
    lamp = lamp.model_copy(update={"length": 0.75})
    moved = LocalFrame(unit=0.25).illumination(lit_by(lamp)).lights[0]
    factor = {"radiance": 1, "irradiance": 1, "intensity": 16}[kind.quantity]
    assert moved.radiance == (3.0 * factor, 2.0 * factor, 1.0 * factor) and (moved.size, moved.length) == (2.0, 3.0)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_only_what_is_outside_stays_out(kind: LightKind) -> None:
    assert reach(light(kind.name), BoxShell(CLOSED), (), (0.0, 0.0, 0.0)).kept != kind.outside


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_caustics_of_what_no_path_meets_are_left_out(kind: LightKind) -> None:
    glass = Material(name="glass", base_color=(1, 1, 1), roughness=0.0, transmission=1.0)
    use = MaterialUse(owner="vase", part="furniture", material=glass, scattered=0.0, smoothest=0.0, roughest=0.0)
    lit = PassLight(name="target", lights=(light(kind.name, size=0.05, length=0.2),), materials=(use,), fog=FogPlan(),
                    depth=12, target_area=1.0)
    assert [each.choice for each in told([(lit, "camera")])] == ["noisy" if kind.extended else "left out"]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_scene_holds_an_emitter_of_each_kind_that_specs_may_ask_for(kind: LightKind, backend: str) -> None:
    from dataset_builder.rendering.scene.emitters import emitters

    held = emitters(lit_by(light(kind.name, length=1.0 if kind.long else 0.0)))
    assert [name.partition("_")[0] for name in held] == [one.name for one in KINDS if one.spare or one == kind]


def test_a_kind_that_a_consumer_lacks_is_an_error(forgotten: LightPlan, backend: str) -> None:
    from dataset_builder.rendering.scene.emitters import emitters

    with pytest.raises(KeyError, match="ring"):
        facing_irradiance(forgotten.kind, 0.2, 1.5)
    with pytest.raises(KeyError, match="ring"):
        direct_irradiance(forgotten, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
    with pytest.raises(KeyError, match="ring"):
        emitters(lit_by(forgotten))


def test_a_quantity_that_nobody_scales_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataset_builder.rendering.scene.local_frame import LocalFrame

    monkeypatch.setitem(LIGHT_KINDS, "sphere", LightKind(name="sphere", quantity="power"))  # type: ignore[arg-type]
    with pytest.raises(KeyError, match="power"):
        LocalFrame(unit=0.5).illumination(lit_by(light("sphere")))
