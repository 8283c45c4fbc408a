"""Illumination of a view: the plain source, and target lights that neither miss the object nor blow it out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.planning.blackbody import LUMINANCE, colour
from dataset_builder.planning.cameras import inside, towards, vector
from dataset_builder.planning.example_plan import CameraPlan, IlluminationPlan, LightPlan, Vector
from dataset_builder.planning.irradiance import direct_irradiance, facing_irradiance, sky_directions
from dataset_builder.planning.sight import Sight
from dataset_builder.planning.stage import Stage
from dataset_builder.spec.light import SourceSpec, TargetSpec
from dataset_builder.spec.numbers import draw

Stream = Callable[..., np.random.Generator]
"""Makes the generator of a path below the view's."""
LIT_SHARE = 0.5
"""Least share of the visible points that must get direct light from a target light."""
LEAST_CLEARANCE = 0.02
"""Metres between surfaces and a light without extent."""
MOST_POINTS = 192
SKY_POINTS, SKY_RAYS = 24, 24
LIFT = 1e-3
"""Metres above a surface that shadow rays start."""
ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """How target light meets the visible part of the object.

    mean: direct irradiance (luminance, mean over visible points) in units of the source's; lit: share of these points
    that any light reaches.
    """

    mean: float
    lit: float


def dome(radiance: float) -> LightPlan:
    """A uniform grey dome."""
    return LightPlan(kind="dome", position=ORIGIN, direction=ORIGIN, size=0.0, cutoff=0.0, radiance=(radiance,) * 3,
                     temperature=0.0, weight=radiance * facing_irradiance("dome", 0.0, 1.0))


def source_light(spec: SourceSpec, stream: Stream) -> IlluminationPlan:
    """The source illumination: uniform dome and optional sun, with what blocks them left out of the pass.

    Raises PlanError where both are drawn as 0.
    """
    lights = [dome(value)] if (value := draw(spec.dome, stream("dome"))) > 0 else []
    if spec.sun is not None and (value := draw(spec.sun.irradiance, stream("sun", "irradiance"))) > 0:
        upward = towards(draw(spec.sun.azimuth, stream("sun", "azimuth")),
                         draw(spec.sun.elevation, stream("sun", "elevation")))
        lights.append(LightPlan(kind="sun", position=ORIGIN, direction=vector(-upward), size=0.0, cutoff=0.0,
                                radiance=(value,) * 3, temperature=0.0, weight=value))
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

    kind: str
    temperature: float
    rng: np.random.Generator


def _candidate(stage: Stage, spec: TargetSpec, emitter: _Emitter, irradiance: float) -> LightPlan:
    """One draw of an emitter; `irradiance` is what strength 1 sends to the object's centre, facing it, as luminance."""
    rng = emitter.rng
    direction = towards(float(rng.uniform(-180, 180)), draw(spec.elevation, rng))
    distance, size = draw(spec.distance, rng), draw(spec.size, rng)
    strength, cutoff = draw(spec.strength, rng), draw(spec.cutoff, rng)
    sized, aimed = emitter.kind in ("area", "sphere"), emitter.kind in ("area", "spot")
    tint = np.array(colour(emitter.temperature))
    radiance = strength * irradiance / facing_irradiance(emitter.kind, size, distance)
    return LightPlan.model_validate({
        "kind": emitter.kind, "position": vector(stage.centre + distance * direction),
        "direction": vector(-direction) if aimed else ORIGIN, "size": size if sized else 0.0,
        "cutoff": cutoff if emitter.kind == "spot" else 0.0, "radiance": vector(radiance * tint),
        "temperature": emitter.temperature, "weight": float(strength * irradiance * tint.mean())})


def _in_the_way(light: LightPlan, camera: np.ndarray, points: np.ndarray) -> bool:
    """Whether an emitter with an extent comes between the camera and points (N, 3) that it should see."""
    along, to_light = points - camera, np.asarray(light.position) - camera
    share = np.clip(along @ to_light / np.einsum("ij,ij->i", along, along), 0, 1)
    return bool((np.linalg.norm(to_light - share[:, None] * along, axis=1) < light.size).any())


def _stands_free(stage: Stage, light: LightPlan, camera: np.ndarray, points: np.ndarray) -> bool:
    """Whether an emitter is in the room, clear of surfaces by its size, and not in the camera's way."""
    position, clearance = np.asarray(light.position), max(light.size, LEAST_CLEARANCE)
    if not inside(stage, position, clearance) or _in_the_way(light, camera, points):
        return False
    return float(stage.everything.distance(position[None])[0]) >= clearance


def sky_share(stage: Stage, sight: Sight) -> float:
    """Share of a dome's irradiance that gets through windows or an open ceiling to the visible points, on average."""
    pick = _spaced(len(sight.points), SKY_POINTS)
    normals = sight.normals[pick]
    aside = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    tangent = np.cross(aside, normals)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    basis = np.stack([tangent, np.cross(normals, tangent), normals], axis=1)
    directions = (sky_directions(SKY_RAYS)[None] @ basis).reshape(-1, 3)
    origins = np.repeat(sight.points[pick] + LIFT * normals, SKY_RAYS, axis=0)
    _, distance = stage.everything.first_hit(origins, directions)
    return float(np.isinf(distance).mean())


def _spaced(count: int, most: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


def expose(stage: Stage, sight: Sight, lights: Sequence[LightPlan], unit: float, sky: float) -> Exposure:
    """How the visible part of the object is lit directly; `sky` is its `sky_share`, `unit` the source's irradiance."""
    pick = _spaced(len(sight.points), MOST_POINTS)
    normals = sight.normals[pick]
    points = sight.points[pick] + LIFT * normals
    total, reached = np.zeros(len(points)), np.zeros(len(points), dtype=bool)
    for light in lights:
        if light.kind == "dome":
            total += light.weight * sky
            continue
        sent = direct_irradiance(light, points, normals) @ LUMINANCE
        open_way = (sent > 0) & ~stage.everything.occluded(points, np.broadcast_to(light.position, points.shape))
        total += sent * open_way
        reached |= open_way
    return Exposure(mean=float(total.mean()) / unit, lit=float(reached.mean()))


def _place_all(stage: Stage, spec: TargetSpec, emitters: Sequence[_Emitter], irradiance: float,
               camera: np.ndarray, points: np.ndarray) -> list[LightPlan] | None:
    lights = []
    for emitter in emitters:
        draws = (_candidate(stage, spec, emitter, irradiance) for _ in range(spec.attempts))
        if (found := next((light for light in draws if _stands_free(stage, light, camera, points)), None)) is None:
            return None
        lights.append(found)
    return lights


def _emitters(spec: TargetSpec, count: int, stream: Stream) -> list[_Emitter]:
    return [_Emitter(kind=spec.kinds[stream(i, "kind").integers(len(spec.kinds))],
                     temperature=draw(spec.temperature, stream(i, "temperature")), rng=stream(i, "position"))
            for i in range(count)]


def _refuse(where: str, rule: str, hint: str) -> PlanError:
    return PlanError([Problem(where=where, path="target", rule=rule, hint=hint)])


@dataclass(frozen=True, kw_only=True, eq=False)
class LitView:
    """What target lights are planned for: a stage, its camera and what that sees, and the source's irradiance."""

    stage: Stage
    camera: CameraPlan
    sight: Sight
    unit: float
    sky: float


def target_light(view: LitView, spec: TargetSpec, stream: Stream, where: str) -> tuple[IlluminationPlan, str]:
    """Target lights for a view, and a note on how they were found.

    Each of n lights sends 1/n of its drawn strength, so that energy does not grow with their number. Positions are
    redrawn, at most `spec.attempts` times, until the mean direct irradiance on the visible part is within
    `spec.brightness` and at least LIT_SHARE of it is reached. Raises PlanError where that never happens, or where
    no light is drawn.
    """
    count = round(draw(spec.lights, stream("count")))
    if count < 1:
        raise _refuse(where, f"expected at least one target light, got {count}", "set target.lights >= 1")
    outside = [dome(value)] if (value := draw(spec.dome, stream("dome"))) > 0 else []
    emitters = _emitters(spec, count, stream)
    means, lits = list[float](), list[float]()
    for attempt in range(spec.attempts):
        lights = _place_all(view.stage, spec, emitters, view.unit / count, np.asarray(view.camera.position),
                            view.sight.points)
        if lights is None:
            break
        shown = expose(view.stage, view.sight, (*lights, *outside), view.unit, view.sky)
        if spec.brightness[0] <= shown.mean <= spec.brightness[1] and shown.lit >= LIT_SHARE:
            note = f"target light: draw {attempt + 1}, direct irradiance {shown.mean:.2f}, reaches {shown.lit:.0%}"
            return IlluminationPlan(lights=(*lights, *outside), open=()), note
        means.append(shown.mean)
        lits.append(shown.lit)
    raise _refuse(where, *_why_not(spec, count, means, lits))


def _why_not(spec: TargetSpec, count: int, means: list[float], lits: list[float]) -> tuple[str, str]:
    """Rule and hint for lights that could not be placed, or that left the object black or blown out."""
    if not means:
        return (f"expected room for a light within target.distance, got none in {spec.attempts} draws that is in the "
                "room, clear of surfaces by its size and out of the camera's way",
                "lower target.distance or target.size, or widen target.elevation")
    low, high = spec.brightness
    if min(means) > high:
        return (f"expected a mean direct irradiance of at most {high:g} on the visible part of the object, got at "
                f"least {min(means):.3g} in {len(means)} draws: it would be blown out", "lower target.strength")
    rule = (f"expected a mean direct irradiance in [{low:g}, {high:g}] on the visible part of the object and light on "
            f"{LIT_SHARE:.0%} of it, got at most {max(means):.3g} and {max(lits):.0%} in {len(means)} draws with "
            f"{count} lights: it would stay black")
    return rule, "raise target.strength, raise target.lights, or widen target.distance and target.elevation"
