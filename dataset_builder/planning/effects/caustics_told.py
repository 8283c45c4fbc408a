"""Caustics: what gathers light in a scene, and how well the paths of a pass find what it throws on other surfaces.

*simulated* is said only where the lamp, the lobe, the samples and the paths let caustic light show (`caustic_error`);
else it is *noisy*. Both come with the error that is expected. *left out* is what no path meets, or fewer than one of a
frame. Light paths that are many enough to show caustics take about twice the time, so they are sent only where
something large gathers light.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf, sqrt

from dataset_builder.assets.asset import Material, is_solid, range_of
from dataset_builder.label.example_plan import Decision, Transport
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.caustic_error import (
    camera_error,
    joined_error,
    lamp_angle,
    lobe_angle,
    shows,
    told_error,
)
from dataset_builder.planning.effects.features import names
from dataset_builder.planning.effects.materials_used import SMOOTH, MaterialUse, is_smooth
from dataset_builder.planning.effects.transport_choice import PassLight, kinds

GATHERS = 0.3
"""Largest roughness of what throws caustics; rougher glass and metal spread light as far as other surfaces do."""
MOSTLY = 0.5
"""Share of metal or of coat above which a surface reflects enough to count."""
LARGE, HALF = 0.6, 0.5
"""Square metres that gather light on one thing, and their share of the target's surface, from which on caustics are
followed from the lamps. Handles, legs, stands and frames are smaller: of the embedded furniture, rods of 0.5 m^2 at
most, which spread light about them. Following it took 1.7 to 2.6 times the time and left 0.85 to 1.2 times the variance
in seven passes of the mini dataset with such things alone."""
REFLECTED, REFRACTED = 3, 4
"""Edges from the camera to a surface and on to a lamp by way of a mirror, and in and out of glass."""
Finding = tuple[str, str]
"""A choice and its reason."""
ORDER = ("simulated", "noisy", "left out")
FOLLOWED = "{light} by way of {things}, found from the lamp's side where it falls on diffuse surfaces"
FEW = "{light} by way of small {things}; few light paths meet it"
SHOWN = "{light} that such surfaces show in mirrors or through glass, by way of {things}"
CHANCE, NARROW = "camera paths meet it by chance", "without extent, found only through narrow lobes"
RARE = ", fewer than one of a frame"
LOST = "{light} by way of {things}; without extent, no path from the camera meets it through smooth glass"
LOST_AGAIN = "{light} that passes {things} and is seen through smooth glass again; without extent, no path meets it"
"""What becomes of light, in words."""


def casters(light: PassLight) -> tuple[MaterialUse, ...]:
    """What gathers light in a pass, and is within reach of its paths."""
    return tuple(use for use in light.materials if gathers(use.material) and _edges(use) <= light.depth)


def large(light: PassLight) -> tuple[MaterialUse, ...]:
    """Those of `casters` that stand on things of which enough gathers light, see `LARGE`."""
    found, areas = casters(light), dict[tuple[str, str], float]()
    for use in found:
        areas[use.owner, use.part] = areas.get((use.owner, use.part), 0.0) + use.area
    least = min(LARGE, HALF * light.target_area)
    return tuple(use for use in found if areas[use.owner, use.part] >= least)


def throws_caustics(light: PassLight) -> bool:
    """Whether lamps shine in a pass and something large gathers their light."""
    return bool(light.lamps and large(light))


def told(passes: Sequence[tuple[PassLight, Transport]]) -> list[Decision]:
    """What becomes of caustics in the passes that run; what is the same in several is said once."""
    where = dict[Finding, list[str]]()
    for light, transport in passes:
        for finding in _findings(light, transport):
            where.setdefault(finding, []).append(light.name)
    return [Decision(effect="caustics", choice=choice, reason=f"{reason} ({', '.join(found)})")
            for (choice, reason), found in where.items()]


def gathers(material: Material) -> bool:
    """Whether a material gathers light; panes only pass it on."""
    coated = range_of(material, "coat")[1] > MOSTLY and range_of(material, "coat_roughness")[0] <= GATHERS
    bulk = is_solid(material) or range_of(material, "metallic")[1] > MOSTLY
    return coated or (bulk and range_of(material, "roughness")[0] <= GATHERS)


def _edges(use: MaterialUse) -> int:
    return REFRACTED if is_solid(use.material) else REFLECTED


def _lobes(use: MaterialUse) -> list[float]:
    """Solid angles of the lobes that send a caster's light on, the narrowest there may be; glass that is smooth in one
    texel and rough in another has two."""
    solid, coat = is_solid(use.material), range_of(use.material, "coat")[1] > MOSTLY
    smoothest = range_of(use.material, "coat_roughness")[0] if coat and not solid else use.smoothest
    if not solid or not is_smooth(use.smoothest):
        return [lobe_angle(smoothest, solid)]
    return [0.0] if is_smooth(use.roughest) else [0.0, lobe_angle(SMOOTH, solid)]


@dataclass(frozen=True, kw_only=True)
class _Part:
    """What becomes of one light's way over one caster."""

    choice: str
    how: str
    """With `{light}` and `{things}` in it."""
    light: LightPlan
    use: MaterialUse
    error: float = inf
    """Expected, see `caustic_error`."""


def _judged(light: PassLight, how: str, lamp: LightPlan, use: MaterialUse, error: float, sure: bool = True) -> _Part:
    """By the error that is expected. sure: whether it may not be larger still."""
    choice = "simulated" if shows(error) and sure else "noisy"
    if error**2 >= light.pixels:
        choice, how = "left out", how + RARE
    return _Part(choice=choice, how=how, light=lamp, use=use, error=error)


def _by_chance(light: PassLight, how: str, lamp: LightPlan, use: MaterialUse, why: str, lost: str) -> list[_Part]:
    """By paths from the camera, for each lobe of a caster."""
    parts, angle = [], lamp_angle(lamp, light.place)
    for lobe in _lobes(use):
        if angle + lobe > 0:
            by = CHANCE if angle > 0 else NARROW
            error = camera_error(angle + lobe, light.spp, is_solid(use.material))
            parts.append(_judged(light, f"{how}; {by}{why}", lamp, use, error, sure=not LIGHT_KINDS[lamp.kind].outside))
        else:
            parts.append(_Part(choice="left out", how=lost + why, light=lamp, use=use))
    return parts


def _parts(light: PassLight, transport: Transport) -> Iterator[_Part]:
    """What becomes of every light's way over every caster."""
    found, wanted = casters(light), large(light)
    followed = light.lamps if transport == "joined" and wanted else ()
    alone = transport == "joined" and light.lamps and not wanted
    why = "; what is small has no light paths of its own" if alone else ""
    for lamp in light.lights:
        angle = lamp_angle(lamp, light.place)
        for use in found:
            error = joined_error(angle + min(_lobes(use)), light.spp, is_solid(use.material), pixels=light.pixels,
                                 batches=light.batches)
            if lamp not in followed:
                yield from _by_chance(light, "{light} by way of {things}", lamp, use, why, LOST)
            elif use in wanted:
                yield _judged(light, FOLLOWED, lamp, use, error)
                yield from _by_chance(light, SHOWN, lamp, use, "", LOST_AGAIN)
            else:
                yield _judged(light, FEW, lamp, use, error * sqrt(LARGE / max(use.area, 1e-6)), sure=False)


def _findings(light: PassLight, transport: Transport) -> list[Finding]:
    gathering = [use for use in light.materials if gathers(use.material)]
    if not gathering:
        return [("none", "no smooth solid glass and no polished metal or coat is in the scene")]
    kept = dict[tuple[str, str], list[_Part]]()
    for part in _parts(light, transport):
        kept.setdefault((part.choice, part.how), []).append(part)
    rows = [(choice, how, parts) for (choice, how), parts in kept.items()]
    rows.sort(key=lambda row: ORDER.index(row[0]))
    found = [(choice, _said(how, parts, light.spp)) for choice, how, parts in rows]
    reached = casters(light)
    if short := [use for use in gathering if use not in reached]:
        told_of = names([use.name for use in short])
        found += [("left out", f"{kinds(light.lights)} by way of {told_of}; paths of {light.depth} edges are too short")
                  ] * bool(light.lights)
    return found


def _said(how: str, parts: Sequence[_Part], spp: int) -> str:
    """A reason in words, with the errors that are expected."""
    things = list(dict.fromkeys(part.use.name for part in parts))
    reason = how.format(light=kinds([part.light for part in parts]), things=names(things))
    errors = sorted(part.error for part in parts if part.error < inf)
    if not errors:
        return reason
    least, most = told_error(errors[0]), told_error(errors[-1])
    at_least = "at least " if any(LIGHT_KINDS[part.light.kind].outside for part in parts) else ""
    between = least if least == most else f"{least} to {most}"
    return f"{reason}; expected error of a pixel's share {at_least}{between} at {spp} spp"
