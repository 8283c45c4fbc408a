"""Target light that a scene's author designed: kept as it is, or beside lights that are drawn."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dataset_builder.assets.scene_model import SceneLight
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.view.daylight import MIN_WEIGHT, Stream
from dataset_builder.planning.view.emission import facing_irradiance
from dataset_builder.planning.view.exposure import expose, weighed_lamp, weighed_outside
from dataset_builder.planning.view.lights import target_light
from dataset_builder.planning.view.lit_view import LitView
from dataset_builder.planning.view.own_lights import TOLD, OwnLights, named, own_lights, refused, times
from dataset_builder.spec.file_scene import SceneLightsSpec
from dataset_builder.spec.light import TargetSpec
from dataset_builder.spec.numbers import draw

HIDDEN = 0.1
"""Least share of what they would send unhindered that lights are scaled by where things stand in their way: a scene
that is lit by way of its walls is not made brighter without bound."""


def scene_light(view: LitView, lights: Sequence[SceneLight], spec: SceneLightsSpec, target: TargetSpec, stream: Stream,
                where: str, scene: Path, root: Path = Path(), alone: int | None = None) -> tuple[IlluminationPlan, str]:
    """The target light of a view in a scene with lights of its own, and a note on what became of them.

    scene: its file, for messages. root, alone: as `target_light` has them. Raises PlanError as it and `own_lights` do;
    where the scene's lights are kept and it has none; and where they leave the object dark or too bright, each named
    with what it sends. `target.brightness` with a minimum of 0 allows the dark.
    """
    if spec.use == "replaced":
        plan, note = target_light(view, target, stream, where, root, alone=alone)
        gone = f"; lights of the scene replaced: {named(each.name for each in lights)}" if lights else ""
        return plan, note + gone
    own = own_lights(lights, spec.dim, scene)
    if not own.lights and spec.use == "kept":
        raise refused(scene, "lights.use", f"expected a scene with lights that shine, got none of {len(lights)}"
                      + "".join(f"; {said}" for said in own.said[:TOLD]), "write `use: replaced`")
    scaled, said = _scaled(view, own, spec, target, stream, where)
    if spec.use == "added":
        plan, note = target_light(view, target, stream, where, root, own=scaled)
        return plan, f"{note}; {said}"
    return _kept(view, scaled, target, where), said


def check_lights_differ(spec: SceneLightsSpec, target: TargetSpec, number: int, where: str) -> None:
    """Raise PlanError for light `number` of a view that would be the same as its first: nothing of it is drawn."""
    drawn = spec.scale == "auto" and not isinstance(target.strength, int | float)
    if spec.use == "kept" and number > 0 and not drawn:
        raise PlanError([Problem(
            where=where, path="splits[].lights", rule=f"expected 1 light for each view where the scene's own are kept, "
            f"got number {number + 1}, which would be the same", hint="set `lights: 1`, or draw `target.strength` from "
            "a distribution and leave the scene's `lights.scale` at auto")])


def _scaled(view: LitView, own: OwnLights, spec: SceneLightsSpec, target: TargetSpec, stream: Stream,
            where: str) -> tuple[list[SceneLight], str]:
    """The lights times one factor, with their weights, and a note."""
    factor, how = 1.0, ""
    if own.lights and spec.scale == "auto":
        strength = draw(target.strength, stream("own", "strength"))
        hindered, unhindered = _mean(view, own.plans), _mean(view, own.plans, shadows=False)
        if unhindered <= 0:
            raise PlanError([Problem(
                where=where, path="lights", rule=f"expected lights of the scene that shine at the object, got none of "
                f"{named(each.name for each in own.lights)}", hint="write `use: added`, or choose another object")])
        factor = strength / max(hindered, HIDDEN * unhindered)
        how = f", for a strength of {strength:.3g}" + (
            f" of which things hide all but {hindered / unhindered:.0%}" if hindered < HIDDEN * unhindered else "")
    elif spec.scale != "auto":
        factor = float(spec.scale)
    lights = [SceneLight(name=each.name, light=_weighed(view, times(each.light, factor)).model_copy(
        update={"name": each.name})) for each in own.lights]
    note = f"lights of the scene: {named(each.name for each in lights) or 'none'}, times {factor:.3g}{how}"
    return lights, "; ".join((note, *own.said))


def _mean(view: LitView, lights: Sequence[LightPlan], *, shadows: bool = True) -> float:
    """Mean direct irradiance on the visible part of the object, in units of the source's; as if nothing were in the way
    without `shadows`."""
    return expose(view.arrangement, view.sight, lights, view.unit, view.sky if shadows else 1.0, shadows=shadows).mean


def _weighed(view: LitView, light: LightPlan) -> LightPlan:
    """A light of a scene with its weight: what it sends to the object's centre, or, from outside, what gets in."""
    if LIGHT_KINDS[light.kind].outside:
        mean = float(np.mean(light.radiance))
        full = light.model_copy(update={"weight": facing_irradiance(light.kind, 0.0, 1.0) * mean})
        return weighed_outside(view, full)
    return weighed_lamp(view, light)


def _kept(view: LitView, lights: Sequence[SceneLight], target: TargetSpec, where: str) -> IlluminationPlan:
    """The lights as the whole target light. Raises PlanError where they leave the object too dark or too bright."""
    plans = tuple(each.light for each in lights)
    shown = expose(view.arrangement, view.sight, plans, view.unit, view.sky)
    sky = any(LIGHT_KINDS[light.kind].all_round for light in plans) and view.sky > MIN_WEIGHT
    lit, (low, high) = 1.0 if sky else shown.lit, target.brightness
    if low <= shown.mean <= high and (lit >= view.least_lit or low == 0):
        return IlluminationPlan(lights=plans, open=())
    sent = sorted(((_mean(view, [each.light]), each.name) for each in lights), reverse=True)
    each = ", ".join(f"{name} {mean:.2g}" for mean, name in sent[:TOLD])
    dark = shown.mean <= high
    raise PlanError([Problem(
        where=where, path="target", rule=f"expected lights of the scene with a mean direct irradiance in [{low:g}, "
        f"{high:g}] on the visible part of the object"
        + (f" and light on {view.least_lit:.0%} of it" if low > 0 else "")
        + f", got {shown.mean:.3g} and {lit:.0%} ({each}" + (", ..." if len(sent) > TOLD else "") + ")",
        hint="take away what encloses the lights with `leave_out`, raise `lights.scale`, write `use: added`, or allow "
        "the dark: target.brightness: [0, ...]" if dark else "lower target.strength or the scene's `lights.scale`")])
