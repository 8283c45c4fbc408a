"""Lights that bring exactly nothing are left out, and only these."""

import pytest

from dataset_builder.label.light_plan import IlluminationPlan, LightPlan
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.effects.light_reach import reach, reaching, said


def light(kind: str, direction: tuple[float, float, float] = (0, 0, 0), radiance: float = 1.0) -> LightPlan:
    return LightPlan(kind=kind, position=(0, 0, 1), direction=direction, size=0.1, cutoff=0, radiance=(radiance,) * 3,
                     temperature=0, weight=radiance)  # type: ignore[arg-type]


def room(windows: int = 0, ceiling: bool = True, glazing: bool = False) -> RoomPlan:
    return RoomPlan(name="room", seed="0", width=4, depth=3, height=2.5, ceiling=ceiling, windows=windows, skirting=0,
                    glazing=glazing)


@pytest.mark.parametrize("kind", ["dome", "sun"])
def test_nothing_from_outside_gets_into_a_closed_room(kind: str) -> None:
    shining = light(kind, (0.3, -0.9, -0.3))
    assert not reach(shining, room(), ()).kept
    assert reach(shining, room(ceiling=False), ()).kept
    assert reach(shining, room(), ("ceiling",)).kept and reach(shining, room(), ("walls",)).kept
    assert reach(shining, room(windows=1), ()).kept


def test_panes_let_light_in() -> None:
    assert reach(light("dome"), room(windows=2, glazing=True), ()).why == "enters through 2 glazed windows"


@pytest.mark.parametrize(("windows", "kept"), [(1, False), (2, True), (3, True), (4, True)])
def test_a_sun_comes_in_through_windows_that_it_shines_at(windows: int, kept: bool) -> None:
    """It travels towards +X and +Y, so it shines at the walls at -X (the second) and -Y (the fourth) from outside."""
    assert reach(light("sun", (0.7, 0.5, -0.5)), room(windows=windows), ()).kept == kept


@pytest.mark.parametrize("kind", ["area", "sphere", "point", "spot"])
def test_lamps_stay_unless_they_are_dark(kind: str) -> None:
    assert reach(light(kind), room(), ()).kept
    assert not reach(light(kind, radiance=0.0), room(), ()).kept


def test_reasons_name_every_light_and_count_equal_ones() -> None:
    lights = (light("area"), light("area"), light("dome"))
    found = reaching(IlluminationPlan(lights=lights, open=()), room())
    assert [each.kept for each in found] == [True, True, False]
    assert said(lights, found) == ("2 of kind area: stands in the room; dome left out: cannot enter a room with a "
                                   "ceiling and no windows")
