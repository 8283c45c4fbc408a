"""When light samples of a dome go through openings, and what is said of it."""

import numpy as np
import pytest

from dataset_builder.label.example_plan import Decision
from dataset_builder.label.scene_plan import LightPlan, RoomPlan
from dataset_builder.planning.effects.daylight_choice import LEAST_SHARE, daylight
from dataset_builder.planning.scene.box_shell import BoxShell
from tests.planning.scene.houses import shell, walled
from tests.plans import light_plan

ROOM = RoomPlan(name="room", seed="1", width=4.4, depth=3.6, height=2.5, ceiling=True, windows=2, skirting=0.08)
NEAR = (0.0, 0.0, 0.0)


def weighing(kind: str, weight: float) -> LightPlan:
    return light_plan(kind).model_copy(update={"weight": weight})


def said(decisions: list[Decision]) -> str:
    assert [decision.effect for decision in decisions] == ["daylight of target"]
    return f"{decisions[0].choice}: {decisions[0].reason}"


def test_a_dome_behind_windows_is_sampled_through_them() -> None:
    portals, decisions = daylight("target", [weighing("dome", 0.1)], BoxShell(ROOM), (), NEAR)
    assert portals == BoxShell(ROOM).openings((), np.zeros(3)).portals and len(portals) == 2
    assert said(decisions) == "through openings: sampled through 2 windows: window_1 (+y), window_2 (-x)"
    open_top = BoxShell(ROOM.model_copy(update={"ceiling": False, "windows": 1}))
    portals, decisions = daylight("target", [weighing("dome", 0.1)], open_top, (), NEAR)
    assert len(portals) == 2
    assert said(decisions) == "through openings: sampled through 1 window: window_1 (+y) and the open top"


def test_where_nothing_is_to_be_gained_it_is_sampled_all_round() -> None:
    dome = [weighing("dome", 1.0)]
    assert said(daylight("target", dome, BoxShell(ROOM), ("ceiling", "walls"), NEAR)[1]) \
        == "all round: the walls are removed"
    assert said(daylight("target", dome, shell(walled(5, 4, 2.5)), ("ceiling",), (2.5, 2, 0))[1]) \
        == "all round: the ceiling is removed"
    image = weighing("dome", 1.0).model_copy(update={"image": "sky.exr"})
    assert said(daylight("target", [image], BoxShell(ROOM), (), NEAR)[1]) \
        == "all round: samples of an image follow what is bright in it"
    weak = [weighing("dome", 0.02), weighing("area", 0.98)]
    portals, decisions = daylight("target", weak, BoxShell(ROOM), (), NEAR)
    assert not portals and said(decisions).startswith("all round: the dome brings 0.02 of the direct")


@pytest.mark.parametrize(("share", "found"), [(0.9 * LEAST_SHARE, 0), (1.1 * LEAST_SHARE, 2)])
def test_the_dome_has_to_bring_its_share(share: float, found: int) -> None:
    lights = [weighing("dome", share), weighing("area", 1 - share)]
    assert len(daylight("target", lights, BoxShell(ROOM), (), NEAR)[0]) == found


def test_without_a_dome_there_is_nothing_to_decide() -> None:
    assert daylight("target", [weighing("area", 1.0), weighing("sun", 1.0)], BoxShell(ROOM), (), NEAR) == ((), [])
    assert daylight("target", [], BoxShell(ROOM), (), NEAR) == ((), [])
