"""Lamps where a spec puts them: drawn, never moved, and refused by name where they cannot be."""

from collections.abc import Callable, Sequence
from math import pi, sqrt
from pathlib import Path

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.light_axes import rectangle_axes
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.geometry.winding import WAYS
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.scene.arrangement import TARGET_INSTANCE, Arrangement
from dataset_builder.planning.scene.room_parts import ROOM_INSTANCE
from dataset_builder.planning.scene.shell import box_of
from dataset_builder.planning.view.cameras import inside, towards, vector
from dataset_builder.planning.view.daylight import ORIGIN, Stream, image_of
from dataset_builder.planning.view.emission import LUMINANCE, colour, facing_irradiance
from dataset_builder.planning.view.exposure import MIN_CLEARANCE, expose, in_the_way, weighed_lamp
from dataset_builder.planning.view.lit_view import LitView
from dataset_builder.spec.lamp import LampSpec
from dataset_builder.spec.light import TargetSpec
from dataset_builder.spec.numbers import AnyNumber, draw

GRID = 17
"""Points along a side of an area light that are looked from for surfaces near it."""
TOLD = 6
"""Lamps that a message names."""


def placed_lamps(view: LitView, spec: TargetSpec, stream: Stream, where: str, root: Path = Path(),
                 alone: int | None = None) -> tuple[list[LightPlan], list[str]]:
    """The lamps of a spec that shine, and a note of those that do not. alone: the only one that does, by its place.

    Every number comes from a path of the lamp's own, by its name or, without one, its place in the list: the others
    may come and go. root: folder of the dataset file. Raises PlanError for lamps that are outside the room, nearer to a
    surface than they are large, inside a thing, or in a camera's way, each named with its place; and where none shines.
    """
    found, off, problems = list[LightPlan](), list[str](), list[Problem]()
    for index, lamp in enumerate(spec.lamps):
        if alone not in (None, index):
            continue
        light = _drawn(view, spec, lamp, stream, index, root)
        if light is None:
            off.append(f"{_called(lamp, index)} is off")
            continue
        problems += [Problem(where=where, path=f"target.lights[{index}]", hint=hint,
                             rule=f"expected {_called(lamp, index)} {rule}") for rule, hint in _faults(view, light)]
        found.append(light)
    if problems:
        raise PlanError(problems)
    if not found:
        raise PlanError([Problem(where=where, path="target.lights", rule=f"expected a lamp that is on, got: "
                                 f"{', '.join(off)}", hint="draw `dim` above 0")])
    return found, off


def require_brightness(view: LitView, spec: TargetSpec, lamps: Sequence[LightPlan], others: Sequence[LightPlan],
                       where: str) -> str:
    """A note on what every lamp sends to the visible part of the object. Raises PlanError where all light together is
    not within `spec.brightness`; how much of it a lamp reaches is the user's own choice."""
    shown = expose(view.arrangement, view.sight, (*lamps, *others), view.unit, view.sky)
    sent = [(lamp.name or lamp.kind, expose(view.arrangement, view.sight, [lamp], view.unit, view.sky).mean)
            for lamp in lamps]
    each = ", ".join(f"{name} {mean:.2g}" for name, mean in sent[:TOLD]) + (", ..." if len(sent) > TOLD else "")
    low, high = spec.brightness
    if low <= shown.mean <= high:
        return f"placed lights: direct irradiance {shown.mean:.2f} ({each}), reaches {shown.lit:.0%}"
    rule = (f"expected a mean direct irradiance in [{low:g}, {high:g}] on the visible part of the object, got "
            f"{shown.mean:.3g} ({each})")
    hint = ("turn lamps up or move them to the camera's side, or allow the dark: target.brightness: [0, ...]"
            if shown.mean < low else "turn lamps down with `dim`")
    raise PlanError([Problem(where=where, path="target", rule=rule, hint=hint)])


def _called(lamp: LampSpec, index: int) -> str:
    return f"lamp {lamp.name}" if lamp.name else f"lamp {index}"


def _drawn(view: LitView, spec: TargetSpec, lamp: LampSpec, stream: Stream, index: int, root: Path) -> LightPlan | None:
    """One draw of a lamp, None of one that is off."""
    def number(name: str, *path: int, value: AnyNumber | None = None) -> float:
        asked = getattr(lamp, name) if value is None else value
        return draw(getattr(spec, name) if asked is None else asked, stream("lamp", lamp.name or index, name, *path))

    def three(name: str, values: Sequence[AnyNumber]) -> np.ndarray:
        return np.array([number(name, k, value=value) for k, value in enumerate(values)])

    dim = number("dim") if lamp.on else 0.0
    if dim == 0:
        return None
    kind, centre = LIGHT_KINDS[lamp.kind], view.arrangement.centre
    if lamp.position is not None:
        position = three("position", lamp.position)
    else:
        direction = towards(view.arrangement.front + number("azimuth"), number("elevation"))
        position = centre + number("distance") * direction
    size = number("size") if kind.sized else 0.0
    temperature = number("temperature") if lamp.color is None else 0.0
    tint = np.array(colour(temperature)) if lamp.color is None else three("color", lamp.color)
    # Nearer than this no lamp stands free of the object
    apart = max(float(np.linalg.norm(position - centre)), MIN_CLEARANCE)
    sent = (number("radiance") * view.unit / pi if lamp.radiance is not None else
            number("strength") * view.unit / facing_irradiance(lamp.kind, size, apart))
    light = LightPlan.model_validate({
        "kind": lamp.kind, "name": lamp.name, "position": vector(position),
        "direction": vector(_aimed(lamp, position, centre, three)) if kind.aimed else ORIGIN, "size": size,
        "cutoff": number("cutoff") if kind.beamed else 0.0,
        "radiance": vector(dim * sent * tint / max(float(tint @ LUMINANCE), 1e-9)), "temperature": temperature,
        "weight": 0.0, **(image_of(root, lamp.texture, f"target.lights[{index}].texture") if lamp.texture else {})})
    return weighed_lamp(view, light) if any(light.radiance) else None


def _aimed(lamp: LampSpec, position: np.ndarray, centre: np.ndarray,
           three: Callable[[str, Sequence[AnyNumber]], np.ndarray]) -> np.ndarray:
    """(3,) unit vector that a lamp shines along; downwards where it is aimed at itself."""
    if lamp.direction is not None:
        way = three("direction", lamp.direction)
    else:
        way = (centre if lamp.aim == "object" else three("aim", lamp.aim)) - position
    length = float(np.linalg.norm(way))
    return way / length if length > 1e-9 else np.array([0.0, 0.0, -1.0])


def _faults(view: LitView, light: LightPlan) -> list[tuple[str, str]]:
    """Why a lamp cannot be where it was put, as the rest of a rule, and a hint."""
    place = f"at [{', '.join(f'{value:.3g}' for value in light.position)}]"
    points, reach = _surface(light)
    if not all(inside(view.arrangement, point, reach) for point in points[::GRID - 1]):
        low, high = view.arrangement.room.width / 2, view.arrangement.room.depth / 2
        bounds = (f"; it has x in [{-low:.3g}, {low:.3g}], y in [{-high:.3g}, {high:.3g}], z in [0, "
                  f"{view.arrangement.room.height:.3g}]" if view.arrangement.room.kind == "procedural" else "")
        return [(f"to be in the {view.arrangement.shell.noun}, {reach:.2g} m from its bounds, got it {place}{bounds}",
                 "move it inwards, or make it smaller with `size`")]
    away = view.arrangement.surfaces.distance(points)
    if away.min() < reach:
        near = _nearest(view.arrangement, points[int(away.argmin())])
        return [(f"to be clear of surfaces by {reach:.2g} m, got it {place}, {away.min():.2g} m from {near}",
                 "move it, or make it smaller with `size`; lamps are never moved for you")]
    if thing := _around(view.arrangement, np.asarray(light.position)):
        return [(f"to be in the open, got it {place}, inside {thing}", "move it; lamps are never moved for you")]
    radius = light.size / sqrt(2) if light.kind == "area" else light.size
    if any(in_the_way(light, radius, np.asarray(camera.position), view.sight.points) for camera in view.cameras):
        # The light-free layers do not show lamps: the picture would show one where they say object
        return [(f"not to stand between the camera and the object, got it {place}",
                 "move it, make it smaller with `size`, or take a spot or a point, which are not seen")]
    return []


def _surface(light: LightPlan) -> tuple[np.ndarray, float]:
    """(N, 3) points of a lamp, and how far from all of them surfaces have to be, metres, to be clear of it."""
    middle = np.array([light.position])
    if light.kind != "area":
        return middle, max(light.size, MIN_CLEARANCE)
    steps = light.size * np.linspace(-0.5, 0.5, GRID)
    first, second = rectangle_axes(light.direction, light.turn)
    points = middle + (steps[:, None, None] * first + steps[None, :, None] * second).reshape(-1, 3)
    return points, max(light.size / (GRID - 1) / sqrt(2), MIN_CLEARANCE)


def _nearest(arrangement: Arrangement, point: np.ndarray) -> str:
    """What is nearest to a point, in words."""
    return _name(arrangement, min(
        arrangement.geometry, key=lambda part: float(RayScene([part]).distance(point[None])[0]))[2])


def _around(arrangement: Arrangement, point: np.ndarray) -> str:
    """What stands there that a point is inside of, in words: rays from it meet that an odd number of times. Empty for
    none."""
    for part in arrangement.geometry:
        low, high = box_of(part)
        if part[2] != ROOM_INSTANCE and (low < point).all() and (point < high).all():
            ways = np.concatenate([WAYS, -WAYS])
            ray, _, _ = RayScene([part]).hits(np.broadcast_to(point, ways.shape), ways)
            # All but one, which may meet two faces on the edge between them
            if (np.bincount(ray, minlength=len(ways)) % 2).sum() >= len(ways) - 1:
                return _name(arrangement, part[2])
    return ""


def _name(arrangement: Arrangement, instance: int) -> str:
    """What an instance is, in words."""
    names = {placed.instance: placed.object.name for placed in arrangement.furniture}
    names |= {TARGET_INSTANCE: "the object", ROOM_INSTANCE: "the building"}
    return names.get(instance, "a thing of the scene")
