"""UsdLux -> SceneLight: every kind of light that OpenUSD has, or why it is none.

https://openusd.org/release/api/usd_lux_page_front.html. Nits are taken for W/(m^2 sr) of a channel, lux for W/m^2, as
they stand: a file's lights keep their brightness to each other, and planning gives all of them one factor.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cbrt, pi, radians, sin
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.light_bounds import MOST_METRES, bounded
from dataset_builder.assets.scene_model import SceneLight
from dataset_builder.assets.scene_readers.usd_light_frames import (
    LightFrame,
    dome_turn,
    frame_of,
    rectangle_turn,
    vector,
)
from dataset_builder.assets.scene_readers.usd_light_images import ImageFinder, shown_image
from dataset_builder.assets.scene_readers.usd_light_shaping import shaped
from dataset_builder.assets.scene_readers.usd_light_values import LightInputs
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.spec.image_uses import ENVIRONMENT_SUFFIXES, TEXTURE_SUFFIXES

if TYPE_CHECKING:
    from pxr import Usd

WIDEST_SUN = 1.0
"""Degrees across of a distant light from which it is said that ours has no extent; the sun has half of it."""
THINNEST = 1e-3
"""Radius of a cylinder over its length, where a line without any radius still has a power."""
DARK = "sends nothing"
NO_PLACE: dict[str, str] = {
    "PortalLight": "a portal only guides sampling of a dome", "GeometryLight": "light of a geometry, deprecated",
    "PluginLight": "a light of another renderer's own kind",
}


@dataclass(frozen=True, kw_only=True)
class FoundLight:
    """What became of one light of a stage."""

    light: SceneLight | None
    """None where it is left out; `said` tells why."""
    said: tuple[str, ...]
    """What is not honoured, or what was decided, in words that name the prim."""


def is_light(prim: "Usd.Prim") -> bool:
    """Whether a prim is a light or a light's filter, for `read_light` to see to."""
    from pxr import UsdLux

    return prim.HasAPI(UsdLux.LightAPI) or prim.IsA(UsdLux.LightFilter)


def read_light(path: Path, prim: "Usd.Prim", world: np.ndarray, *, unit: float = 1.0,
               image: ImageFinder | None = None) -> FoundLight:
    """The light of a prim at its first time.

    path: of the stage, for messages. world: (4, 4) to metres, Z up, from the prim's own axes. unit: metres of the
    stage's unit: what is normalised is so by areas of its world space. image: finds the file of a texture; None shows
    none. Raises UserError, with file and prim, for numbers that no light has.
    """
    from pxr import Usd, UsdGeom

    inputs = LightInputs(path=path, prim=prim)
    kind = str(prim.GetTypeName())
    if reason := _no_light(prim, kind):
        return _none(inputs, kind, reason)
    imageable = UsdGeom.Imageable(prim)
    if imageable and imageable.ComputeVisibility(Usd.TimeCode.EarliestTime()) == UsdGeom.Tokens.invisible:
        return _none(inputs, kind, "invisible")
    plan = _READERS[_base(prim)](inputs, frame_of(path, inputs.name, world, unit), image)
    inputs.name_the_rest()
    if plan is None or not any(plan.radiance):
        return _none(inputs, kind, DARK)
    for value in (*plan.position, plan.size, plan.length):
        bounded(path, inputs.name, "place and size in metres", value, low=-MOST_METRES, high=MOST_METRES)
    for value in plan.radiance:
        bounded(path, inputs.name, "brightness", value)
    return FoundLight(light=SceneLight(name=inputs.name, light=plan),
                      said=tuple(f"light {inputs.name}: {what}" for what in inputs.said))


def _none(inputs: LightInputs, kind: str, why: str) -> FoundLight:
    return FoundLight(light=None, said=(f"light {inputs.name} of kind {kind or 'none'} left out: {why}",))


def _base(prim: "Usd.Prim") -> str:
    """The kind of UsdLux that a prim is, or is derived from; empty for none that is read."""
    from pxr import UsdLux

    return next((name for name in _READERS if prim.IsA(getattr(UsdLux, name))), "")


def _no_light(prim: "Usd.Prim", kind: str) -> str:
    """Why a prim is no light that is read, empty where it is one."""
    from pxr import UsdGeom, UsdLux

    if prim.IsA(UsdLux.LightFilter):
        return "light filters are not honoured"
    if kind in NO_PLACE:
        return NO_PLACE[kind]
    if prim.IsA(UsdGeom.Gprim):
        return "a mesh or volume that shines: its shape is taken, its light is not, but for what its material emits"
    return "" if _base(prim) else "a light of a kind that is not read"


def _plan(kind: str, frame: LightFrame, inputs: LightInputs, radiance: np.ndarray, **more: object) -> LightPlan:
    given = {"kind": kind, "position": frame.position, "direction": frame.down, "size": 0.0, "cutoff": 0.0,
             "radiance": vector(radiance), "temperature": inputs.temperature(), "weight": 0.0}
    return LightPlan.model_validate(given | more)


def _normalised(inputs: LightInputs, size_factor: float) -> np.ndarray:
    """(3,) emission, over the light's size where it is to be."""
    emission = inputs.emission()
    return emission / size_factor if inputs.value("normalize", False) else emission


def _radiance(inputs: LightInputs, frame: LightFrame, area: float) -> np.ndarray:
    """(3,) emission, over its area (square metres) in the stage's unit where it is to be."""
    return _normalised(inputs, area / frame.unit ** 2)


def _distant(inputs: LightInputs, frame: LightFrame, _: ImageFinder | None) -> LightPlan:
    angle = inputs.number("angle", 0.53, high=360.0)
    half = radians(angle) / 2
    disc = pi * sin(half) ** 2
    size_factor = 1.0 if half == 0 else disc if half <= pi / 2 else 2 * pi - disc
    # What a disc of sky this wide sends to a surface that faces its middle
    facing = 1.0 if half == 0 else disc if half <= pi / 2 else pi
    if angle > WIDEST_SUN:
        inputs.say(f"angle of {angle:g} degrees; a sun has no extent here")
    return _plan("sun", frame, inputs, _normalised(inputs, size_factor) * facing, position=(0.0, 0.0, 0.0))


def _dome(inputs: LightInputs, frame: LightFrame, image: ImageFinder | None) -> LightPlan:
    radiance = inputs.emission()
    shown = shown_image(inputs, image, ENVIRONMENT_SUFFIXES, on_sphere=True)
    if shown is None:
        return _plan("dome", frame, inputs, radiance, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 0.0))
    return _plan("dome", frame, inputs, radiance * shown.mean, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 0.0),
                 turn=0.0 if shown.plain else dome_turn(inputs, frame), **shown.fields)


def _rect(inputs: LightInputs, frame: LightFrame, image: ImageFinder | None) -> LightPlan | None:
    x, y, _ = frame.axes
    width = inputs.number("width", 1.0, high=MOST_METRES) * float(np.linalg.norm(x))
    height = inputs.number("height", 1.0, high=MOST_METRES) * float(np.linalg.norm(y))
    frame.say_sheared(inputs)
    if width * height == 0:
        return None
    shown = shown_image(inputs, image, TEXTURE_SUFFIXES, on_sphere=False)
    area = width * height
    if shown and np.dot(np.cross(x, y), frame.down) > 0:
        inputs.say("a mirrored image; it is shown unmirrored")
    plan = _plan("area", frame, inputs, _radiance(inputs, frame, area) * (shown.mean if shown else 1.0), size=width,
                 length=height, turn=rectangle_turn(frame), **(shown.fields if shown else {}))
    return shaped(inputs, plan, frame, area=area, width=max(width, height))


def _disk(inputs: LightInputs, frame: LightFrame, _: ImageFinder | None) -> LightPlan | None:
    x, y, _z = (float(np.linalg.norm(axis)) for axis in frame.axes)
    frame.say_uneven(inputs, (x, y), "an ellipse, taken as a disk of the same area")
    radius = inputs.number("radius", 0.5, high=MOST_METRES) * (x * y) ** 0.5
    if radius == 0:
        return None
    area = pi * radius ** 2
    plan = _plan("disk", frame, inputs, _radiance(inputs, frame, area), size=radius)
    return shaped(inputs, plan, frame, area=area, width=2 * radius)


def _sphere(inputs: LightInputs, frame: LightFrame, _: ImageFinder | None) -> LightPlan | None:
    scales = tuple(float(np.linalg.norm(axis)) for axis in frame.axes)
    frame.say_uneven(inputs, scales, "an ellipsoid, taken as a ball of its mean radius")
    radius = inputs.number("radius", 0.5, high=MOST_METRES) * cbrt(scales[0] * scales[1] * scales[2])
    normalised, emission = inputs.value("normalize", False), inputs.emission()
    # A ball of radiance L looks like a disc of it: pi r^2 L, over 4 pi r^2 where it is normalised
    intensity = emission / 4 * frame.unit ** 2 if normalised else emission * pi * radius ** 2
    if inputs.value("treatAsPoint", False) or radius == 0:
        plan = _plan("point", frame, inputs, intensity, direction=(0.0, 0.0, 0.0))
        return shaped(inputs, plan, frame, area=1.0, width=0.0)
    plan = _plan("sphere", frame, inputs, _radiance(inputs, frame, 4 * pi * radius ** 2), size=radius,
                 direction=(0.0, 0.0, 0.0))
    return shaped(inputs, plan, frame, area=pi * radius ** 2, width=2 * radius)


def _cylinder(inputs: LightInputs, frame: LightFrame, _: ImageFinder | None) -> LightPlan | None:
    x, y, z = (float(np.linalg.norm(axis)) for axis in frame.axes)
    frame.say_uneven(inputs, (y, z), "a cylinder of an ellipse, taken as one of a disk")
    length = inputs.number("length", 1.0, high=MOST_METRES) * x
    radius = inputs.number("radius", 0.5, high=MOST_METRES) * (y * z) ** 0.5
    if length == 0 or (radius == 0 and not inputs.value("normalize", False)):
        return None
    if radius < THINNEST * length and inputs.value("normalize", False):
        inputs.say(f"radius {radius:g} m, taken as {THINNEST * length:g} m of the same power")
        radius = THINNEST * length
    if inputs.value("treatAsLine", False):
        inputs.say("treatAsLine, a hint; it is a cylinder here")
    plan = _plan("cylinder", frame, inputs, _radiance(inputs, frame, 2 * pi * radius * length), size=radius,
                 length=length, direction=vector(frame.axes[0] / x))
    return shaped(inputs, plan, frame, area=2 * radius * length, width=length)


_READERS: dict[str, Callable[[LightInputs, LightFrame, ImageFinder | None], LightPlan | None]] = {
    "DistantLight": _distant, "DomeLight": _dome, "DomeLight_1": _dome, "RectLight": _rect, "DiskLight": _disk,
    "SphereLight": _sphere, "CylinderLight": _cylinder,
}
"""How each kind is read, by its name in UsdLux."""
