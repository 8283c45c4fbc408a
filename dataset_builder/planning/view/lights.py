"""Illumination of a view: the plain source, and target lights that neither miss the object nor overexpose it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.scene_model import SceneLight
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS, LightName
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import inside, towards, vector
from dataset_builder.planning.view.daylight import ORIGIN, Stream, image_of, outside, sky_share
from dataset_builder.planning.view.emission import colour, facing_irradiance
from dataset_builder.planning.view.exposure import MIN_CLEARANCE, expose, in_the_way, weighed_outside
from dataset_builder.planning.view.lit_view import LitView
from dataset_builder.planning.view.own_lights import one_dome
from dataset_builder.planning.view.placed_lamps import placed_lamps, require_brightness
from dataset_builder.spec.light import SourceSpec, TargetSpec
from dataset_builder.spec.numbers import draw

__all__ = ["sky_share", "source_light", "target_light", "unit_irradiance"]


def source_light(spec: SourceSpec, stream: Stream, root: Path = Path(),
                 arrangement: Arrangement | None = None) -> IlluminationPlan:
    """The source illumination: dome and optional sun, with what blocks them left out of the pass. root: folder of the
    dataset file. arrangement: what has the windows.

    Raises PlanError where both are drawn as 0, where the image of the sky cannot be read, or where a sun cannot shine
    through its window.
    """
    lights = outside(spec, stream, root, "source", arrangement)
    if not lights:
        raise PlanError([Problem(where="", path="source", rule="expected a dome or a sun above 0, got neither",
                                 hint="set source.dome")])
    return IlluminationPlan(lights=tuple(lights), open=spec.open)


def unit_irradiance(source: IlluminationPlan) -> float:
    """Irradiance that strengths are measured in: the source dome's, or the sun's where there is no dome."""
    return source.lights[0].weight


@dataclass(frozen=True, kw_only=True)
class _Emitter:
    """What one emitter is, and the generator of where it stands."""

    kind: LightName
    temperature: float
    image: dict[str, str]
    rng: np.random.Generator


def _candidate(arrangement: Arrangement, spec: TargetSpec, emitter: _Emitter, irradiance: float) -> LightPlan:
    """One draw of an emitter; `irradiance` is what strength 1 sends to the object's centre, facing it, as luminance."""
    rng = emitter.rng
    direction = towards(float(rng.uniform(-180, 180)), draw(spec.elevation, rng))
    distance, size = draw(spec.distance, rng), draw(spec.size, rng)
    strength, cutoff = draw(spec.strength, rng), draw(spec.cutoff, rng)
    kind = LIGHT_KINDS[emitter.kind]
    tint = np.array(colour(emitter.temperature))
    radiance = strength * irradiance / facing_irradiance(emitter.kind, size, distance)
    return LightPlan.model_validate({
        "kind": emitter.kind, "position": vector(arrangement.centre + distance * direction),
        "direction": vector(-direction) if kind.aimed else ORIGIN, "size": size if kind.sized else 0.0,
        "cutoff": cutoff if kind.beamed else 0.0, "radiance": vector(radiance * tint),
        "temperature": emitter.temperature, "weight": float(strength * irradiance * tint.mean()),
        **emitter.image})


def _stands_free(view: LitView, light: LightPlan) -> bool:
    """Whether an emitter is in the room or scene, clear of surfaces by its size, and in no camera's way."""
    position, clearance = np.asarray(light.position), max(light.size, MIN_CLEARANCE)
    if not inside(view.arrangement, position, clearance):
        return False
    if any(in_the_way(light, light.size, np.asarray(camera.position), view.sight.points) for camera in view.cameras):
        return False
    return float(view.arrangement.surfaces.distance(position[None])[0]) >= clearance


def _place_all(view: LitView, spec: TargetSpec, emitters: Sequence[_Emitter]) -> list[LightPlan] | None:
    lights, irradiance = [], view.unit / len(emitters)
    for emitter in emitters:
        draws = (_candidate(view.arrangement, spec, emitter, irradiance) for _ in range(spec.attempts))
        if (found := next((light for light in draws if _stands_free(view, light)), None)) is None:
            return None
        lights.append(found)
    return lights


def _emitters(spec: TargetSpec, count: int, stream: Stream, root: Path) -> list[_Emitter]:
    kinds = [spec.kinds[stream(i, "kind").integers(len(spec.kinds))] for i in range(count)]
    return [_Emitter(kind=kind, temperature=draw(spec.temperature, stream(i, "temperature")),
                     image=_texture(spec, stream(i, "texture"), root) if LIGHT_KINDS[kind].image else {},
                     rng=stream(i, "position"))
            for i, kind in enumerate(kinds)]


def _texture(spec: TargetSpec, rng: np.random.Generator, root: Path) -> dict[str, str]:
    """Fields of an area light that shows one of the spec's images, if it has any."""
    if not spec.textures:
        return {}
    return image_of(root, spec.textures[rng.integers(len(spec.textures))], "target.textures")


def _refuse(where: str, rule: str, hint: str) -> PlanError:
    return PlanError([Problem(where=where, path="target", rule=rule, hint=hint)])


def target_light(view: LitView, spec: TargetSpec, stream: Stream, where: str, root: Path = Path(),
                 own: Sequence[SceneLight] = (), alone: int | None = None) -> tuple[IlluminationPlan, str]:
    """Target lights for a view, and a note on how they were found. root: folder of the dataset file. own: lights that
    the scene has besides, weighed. alone: the placed lamp that shines without any other light.

    Each of n random lights sends 1/n of its drawn strength, so that energy does not grow with their number. Positions
    are redrawn, at most `spec.attempts` times, until the mean direct irradiance on the visible part is within
    `spec.brightness` and at least `view.least_lit` of it is reached; lamps that are placed stay there. Light from
    outside counts where it gets in, and is weighed by that. Raises PlanError where no draw is right, a lamp cannot be
    where it is put, no light is drawn, or an image cannot be read.
    """
    drawn = [weighed_outside(view, light) for light in outside(
        spec, stream, root, "target", view.arrangement)] if alone is None else []
    found, merged = one_dome([*(SceneLight(name=f"the dataset's {light.kind}", light=light) for light in drawn), *own])
    others = [each.light for each in found]
    if isinstance(spec.lights, tuple):
        lamps, off = placed_lamps(view, spec, stream, where, root, alone)
        note = require_brightness(view, spec, lamps, others, where)
        return IlluminationPlan(lights=(*lamps, *others), open=()), "; ".join((note, *off, *merged))
    count = round(draw(spec.lights, stream("count")))
    if count < 1:
        raise _refuse(where, f"expected at least one target light, got {count}", "set target.lights >= 1")
    emitters = _emitters(spec, count, stream, root)
    means, lits = list[float](), list[float]()
    for attempt in range(spec.attempts):
        if (lights := _place_all(view, spec, emitters)) is None:
            break
        shown = expose(view.arrangement, view.sight, (*lights, *others), view.unit, view.sky)
        if spec.brightness[0] <= shown.mean <= spec.brightness[1] and shown.lit >= view.least_lit:
            note = f"target light: draw {attempt + 1}, direct irradiance {shown.mean:.2f}, reaches {shown.lit:.0%}"
            note = "; ".join((note, *merged))
            return IlluminationPlan(lights=(*lights, *others), open=()), note
        means.append(shown.mean)
        lits.append(shown.lit)
    raise _refuse(where, *_why_not(spec, count, means, lits, view))


def _why_not(spec: TargetSpec, count: int, means: list[float], lits: list[float], view: LitView) -> tuple[str, str]:
    """Rule and hint for lights that could not be placed, or that left the object black or blown out."""
    if not means:
        cameras = f"any of {len(view.cameras)} cameras" if len(view.cameras) > 1 else "the camera"
        return (f"expected a free place for a light within target.distance, got none in {spec.attempts} draws (in the "
                f"{view.arrangement.shell.noun}, clear of surfaces by its size, not in front of {cameras})",
                "lower target.distance or target.size, or widen target.elevation")
    low, high = spec.brightness
    if min(means) > high:
        return (f"expected a mean direct irradiance of at most {high:g} on the visible part of the object, got at "
                f"least {min(means):.3g} in {len(means)} draws: it would be overexposed", "lower target.strength")
    rule = (f"expected a mean direct irradiance in [{low:g}, {high:g}] on the visible part of the object and light on "
            f"{view.least_lit:.0%} of it, got at most {max(means):.3g} and {max(lits):.0%} in {len(means)} draws with "
            f"{count} lights: it would stay black")
    hint = "raise target.strength, raise target.lights, or widen target.distance and target.elevation"
    return rule, hint if spec.sun is None else f"{hint}; the sun counts, too: turn it, so that it reaches the object"
