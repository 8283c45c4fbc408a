"""Lights that bring exactly nothing are left out, and only these; the bound on paths holds, and what is cut is said."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dataset_builder.assets.asset import Material, Texture, range_of
from dataset_builder.label.scene_plan import FogPlan, IlluminationPlan, LightPlan, RoomPlan
from dataset_builder.light_kinds import LampName
from dataset_builder.planning.effects.light_left import MAX_DEPTH, LightLeft
from dataset_builder.planning.effects.materials_used import MaterialUse
from dataset_builder.planning.effects.reach import (
    MIN_DEPTH,
    UNKNOWN_DEPTH,
    bends,
    needed_depth,
    path_depth,
    reach,
    reaching,
    said,
)
from dataset_builder.planning.scene.box_shell import BoxShell

SHARES, BIASES = st.floats(0, 1), st.floats(1e-6, 0.5)
CLEAR = FogPlan()
MIDDLE = (0.0, 0.0, 0.0)


def light(kind: str, direction: tuple[float, float, float] = (0, 0, 0), radiance: float = 1.0) -> LightPlan:
    return LightPlan(kind=kind, position=(0, 0, 1), direction=direction, size=0.1, cutoff=0, radiance=(radiance,) * 3,
                     temperature=0, weight=radiance)  # type: ignore[arg-type]


def room(windows: int = 0, ceiling: bool = True, glazing: bool = False) -> BoxShell:
    return BoxShell(RoomPlan(name="room", seed="0", width=4, depth=3, height=2.5, ceiling=ceiling, windows=windows,
                             skirting=0, glazing=glazing))


@pytest.mark.parametrize("kind", ["dome", "sun"])
def test_nothing_from_outside_gets_into_a_closed_room(kind: str) -> None:
    shining = light(kind, (0.3, -0.9, -0.3))
    assert not reach(shining, room(), (), MIDDLE).kept
    assert reach(shining, room(ceiling=False), (), MIDDLE).kept
    assert reach(shining, room(), ("ceiling",), MIDDLE).kept and reach(shining, room(), ("walls",), MIDDLE).kept
    assert reach(shining, room(windows=1), (), MIDDLE).kept


def test_panes_let_light_in() -> None:
    assert reach(light("dome"), room(windows=2, glazing=True), (), MIDDLE).why == \
        "enters through 2 glazed windows: window_1 (+y), window_2 (-x)"


@pytest.mark.parametrize(("windows", "kept"), [(1, False), (2, True), (3, True), (4, True)])
def test_a_sun_comes_in_through_windows_that_it_shines_at(windows: int, kept: bool) -> None:
    """It travels towards +X and +Y, so it shines at the walls at -X (the second) and -Y (the fourth) from outside."""
    assert reach(light("sun", (0.7, 0.5, -0.5)), room(windows=windows), (), MIDDLE).kept == kept


@pytest.mark.parametrize("kind", get_args(LampName))
def test_lamps_stay_unless_they_are_dark(kind: str) -> None:
    assert reach(light(kind), room(), (), MIDDLE).kept
    assert not reach(light(kind, radiance=0.0), room(), (), MIDDLE).kept


def test_reasons_name_every_light_and_count_equal_ones() -> None:
    lights = (light("area"), light("area"), light("dome"))
    found = reaching(IlluminationPlan(lights=lights, open=()), room(), MIDDLE)
    assert [each.kept for each in found] == [True, True, False]
    assert said(lights, found) == ("2 of kind area: stands in the room; dome left out: cannot enter a room with a "
                                   "ceiling and no windows")


def use(scattered: float, **more: object) -> MaterialUse:
    surface = Material(name="grey", base_color=(scattered,) * 3, **more)  # type: ignore[arg-type]
    return MaterialUse(owner="chair", part="furniture", material=surface, scattered=scattered,
                       smoothest=range_of(surface, "roughness")[0], roughest=range_of(surface, "roughness")[1])


@given(share=SHARES, bias=BIASES)
def test_the_bound_holds_and_no_shorter_path_keeps_it(share: float, bias: float) -> None:
    depth = needed_depth(share, bias)
    if depth <= MAX_DEPTH:
        assert share ** (depth - 1) <= bias
    else:
        assert share ** (MAX_DEPTH - 1) > bias
    assert depth == 2 or share ** (min(depth, MAX_DEPTH + 1) - 2) > bias


def falling(share: float, paths: int = 1000) -> LightLeft:
    """What is left where every event leaves `share`, known exactly."""
    left = np.minimum(share ** np.maximum(np.arange(MAX_DEPTH + 1.0) - 1, 0), 1)
    return LightLeft(paths=paths, share=left, bound=left)


@given(share=SHARES, bias=BIASES, glass=st.booleans())
def test_planned_depths_keep_the_bias_or_say_that_they_are_cut(share: float, bias: float, glass: bool) -> None:
    materials = [use(0.0), use(share), *([use(0.1, transmission=1.0, roughness=0.0)] if glass else [])]
    found = path_depth("auto", bias, materials, CLEAR, falling(share))
    assert MIN_DEPTH <= found.depth <= MAX_DEPTH and found.kept == (found.left_out <= bias)
    assert found.left_out == pytest.approx(share ** (found.depth - 1))
    assert found.kept or "cut at 512" in found.reason


def test_worked_by_hand() -> None:
    """0.5^4 = 0.0625, 0.5^5 = 0.03125."""
    nothing = LightLeft(paths=0, share=np.ones(MAX_DEPTH + 1), bound=np.ones(MAX_DEPTH + 1))
    assert path_depth("auto", 0.05, [use(0.5)], CLEAR, nothing).depth == 6
    assert path_depth("auto", 0.05, [use(0.01)], CLEAR, nothing).depth == MIN_DEPTH
    assert path_depth("auto", 0.05, [use(0.9)], CLEAR, falling(0.5)).depth == 6


def test_the_brightest_material_is_no_bound_where_the_estimate_is_above_it() -> None:
    """A picture of the dark side of a room sees what its average does not."""
    found = path_depth("auto", 0.05, [use(0.5)], CLEAR, falling(0.8))
    assert found.depth == needed_depth(0.8, 0.05) > needed_depth(0.5, 0.05)


@pytest.mark.parametrize(("glass", "lossless"), [
    ({"transmission": 1.0, "roughness": 0.0}, True),
    ({"transmission": 0.1, "roughness": 0.5}, True),
    ({"transmission": 1.0, "roughness": 0.0, "thin": True}, False),
    ({"transmission": 1.0, "roughness": 0.5, "thin": True}, True),
    ({"transmission": 1.0, "roughness": 0.0, "metallic": 1.0}, False)])
def test_only_the_estimate_counts_where_glass_takes_edges(glass: dict[str, float], lossless: bool) -> None:
    materials = [use(0.3), use(0.1, **glass)]
    assert bends(materials) == lossless
    assert path_depth("auto", 0.01, materials, CLEAR, falling(0.9)).depth == needed_depth(0.9, 0.01)
    unknown = LightLeft(paths=0, share=np.ones(MAX_DEPTH + 1), bound=np.ones(MAX_DEPTH + 1))
    assert path_depth("auto", 0.01, materials, CLEAR, unknown).depth == (
        UNKNOWN_DEPTH if lossless else needed_depth(0.3, 0.01))


def test_textured_glass_counts_where_a_texel_of_it_is_metal_no_more_or_rough() -> None:
    white = np.ones((1, 2, 3), dtype=np.float32)
    texels = np.array([[0.0, 1.0]], dtype=np.float32)
    pane = use(0.1, transmission=1.0, thin=True, texture=Texture(base_color=white, roughness=texels))
    part = use(0.1, transmission=1.0, metallic=1.0, texture=Texture(base_color=white, metallic=texels))
    assert bends([pane]) and bends([part])
    whole = Texture(base_color=white, metallic=np.ones_like(texels))
    assert not bends([use(0.1, transmission=1.0, metallic=1.0, texture=whole)])


def test_what_is_asked_for_is_taken_with_the_bound_that_it_keeps() -> None:
    found = path_depth(5, 0.01, [use(0.5)], CLEAR, falling(0.5))
    assert found.depth == 5 and found.left_out == pytest.approx(0.5**4) and not found.kept
    assert "requested" in found.reason and "0.062" in found.reason
