"""A sun that is aimed at an opening of a scene from a file, whichever way the scene is turned."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.planning.view.cameras import towards
from dataset_builder.planning.view.sun_window import faced, require_entry
from tests.planning.scene.houses import shell, turned, windowed

HERE = np.array([2.5, 2.0, 0.0])


def arranged(degrees: float = 0.0) -> Any:
    turn = turned([(HERE[None], np.zeros((0, 3)), 0)], degrees)[0][0][0]
    space = shell(turned(windowed(), degrees))
    return SimpleNamespace(shell=space, centre=turn, everything=space.space.everything)


@pytest.mark.parametrize("degrees", [0, 30, 100])
def test_a_sun_shines_straight_into_an_opening(degrees: float) -> None:
    scene = arranged(degrees)
    azimuth = faced(scene, "opening_1", "target")
    # The window is in +y, which azimuth 180 is
    assert (azimuth - degrees) % 360 == pytest.approx(180, abs=1)
    require_entry(scene, "opening_1", azimuth, 20, "target")
    way = -towards(azimuth, 20)
    assert scene.everything.first_hit(scene.centre[None] + [0, 0, 0.8], -way[None])[1][0] > 1
    with pytest.raises(PlanError, match="behind its wall"):
        require_entry(scene, "opening_1", azimuth + 180, 20, "target")
    with pytest.raises(PlanError, match="'window_1': there is opening_1"):
        faced(scene, "window_1", "target")


def test_a_steep_sun_ends_on_the_wall() -> None:
    """Light is within from 0.25 m on. From the lintel at 2 m it gets there before it falls on the floor up to an
    elevation of arctan(2 / 0.25), 82.9 degrees."""
    require_entry(arranged(), "opening_1", 180, 82, "target")
    with pytest.raises(PlanError, match="ends on the frame, the wall or what stands before it"):
        require_entry(arranged(), "opening_1", 180, 84, "target")
