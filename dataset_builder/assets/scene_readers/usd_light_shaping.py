"""UsdLux's shaping of light: cones become spots where the light is small, all else is said."""

from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.light_bounds import LEAST_BEAM
from dataset_builder.assets.scene_readers.usd_light_frames import LightFrame, vector
from dataset_builder.label.scene_plan import LightPlan

if TYPE_CHECKING:
    from dataset_builder.assets.scene_readers.usd_light_values import LightInputs

SMALL = 0.5
"""Metres across below which a light with a cone becomes a spot."""
ALL_ROUND = ("sphere", "point", "cylinder")
"""Kinds that a cone of 90 degrees or more still takes something from."""
CONE = 90.0
"""Degrees of a cone that is not written, where shaping applies."""
NARROWEST = 0.1
"""Degrees of the narrowest spot."""


def shaped(inputs: "LightInputs", plan: LightPlan, frame: LightFrame, *, area: float,
           width: float) -> LightPlan:
    """The light with its cone, where it has one: a spot if it is small, else as it was, which is said.

    plan: unshaped. frame: its axes. area: square metres that it shows from along its axis, 1 for an intensity. width:
    metres across.
    """
    from pxr import UsdLux

    if not inputs.prim.HasAPI(UsdLux.ShapingAPI):
        stray = [name for name in ("shaping:cone:angle", "shaping:focus", "shaping:ies:file")
                 if inputs.prim.GetAttribute(f"inputs:{name}").IsAuthored()]
        if stray:
            inputs.say(f"{' and '.join(stray)} without ShapingAPI, which OpenUSD passes over")
        return plan
    _say_unread(inputs)
    angle = inputs.number("shaping:cone:angle", CONE, high=1e6)
    if angle >= (180.0 if plan.kind in ALL_ROUND else 90.0):
        return plan
    if width > SMALL or plan.image:
        why = "shows an image" if plan.image else f"is {width:.3g} m across, where spots are at most {SMALL:g} m"
        inputs.say(f"cone of {angle:g} degrees, since the light {why}")
        return plan
    if angle < NARROWEST:
        inputs.say(f"cone of {angle:g} degrees, taken as {NARROWEST:g}")
    cutoff = max(angle, NARROWEST)
    softness = float(np.clip(inputs.number("shaping:cone:softness", 0.0, low=-1e6, high=1e6), 0, 1))
    if plan.kind != "point":
        inputs.say(f"extent of {width:.3g} m, for with its cone it is a spot")
    if softness > 0:
        inputs.say("smooth edge of its cone, which falls linearly here")
    return plan.model_copy(update={
        "kind": "spot", "radiance": vector(np.array(plan.radiance) * area), "size": 0.0, "length": 0.0, "turn": 0.0,
        "cutoff": cutoff, "beam": max((1 - softness) * cutoff, LEAST_BEAM), "direction": frame.down})


def _say_unread(inputs: "LightInputs") -> None:
    """Say what shapes light besides cones."""
    focus = inputs.number("shaping:focus", 0.0, low=-1e6, high=1e6)
    if focus > 0 and not np.allclose(inputs.numbers("shaping:focusTint", (0, 0, 0)), 1):
        inputs.say(f"focus {focus:g}")
    if path := getattr(inputs.value("shaping:ies:file"), "path", ""):
        inputs.say(f"IES profile {path}")
