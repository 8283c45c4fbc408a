"""Caustics: what gathers light in a scene, and how well the paths of a pass find what it throws on other surfaces.

*simulated* is said only of light that a lamp sends through glass or off metal onto a diffuse surface and that light
paths follow. All else is found by chance, *noisy*, or not at all, *left out*. Light paths that are many enough to show
caustics take about twice the time, so they are sent only where something large gathers light.
"""

from collections.abc import Sequence

from dataset_builder.assets.asset import Material, is_solid, range_of
from dataset_builder.label.example_plan import Decision, Transport
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.features import names
from dataset_builder.planning.effects.materials_used import MaterialUse, is_smooth
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


def _lose(uses: Sequence[MaterialUse]) -> list[MaterialUse]:
    """Those that have smooth glass, which no path from the camera can find a lamp without extent through."""
    return [use for use in uses if is_solid(use.material) and is_smooth(use.smoothest)]


def _spread(uses: Sequence[MaterialUse]) -> list[MaterialUse]:
    """Those that have lobes of some width."""
    return [use for use in uses if not (is_solid(use.material) and is_smooth(use.roughest))]


def _edges(use: MaterialUse) -> int:
    return REFRACTED if is_solid(use.material) else REFLECTED


def _findings(light: PassLight, transport: Transport) -> list[Finding]:
    gathering = [use for use in light.materials if gathers(use.material)]
    if not gathering:
        return [("none", "no smooth solid glass and no polished metal or coat is in the scene")]
    found, wanted = casters(light), large(light)
    short, small = ([use for use in each if use not in other] for each, other in ((gathering, found), (found, wanted)))
    followed = light.lamps if transport == "joined" and wanted else ()
    alone = transport == "joined" and light.lamps and not wanted
    why = "; what is small has no light paths of its own" if alone else ""
    met = [each for each in light.lights if LIGHT_KINDS[each.kind].extended]
    points = [each for each in light.lights if each not in met]
    # Textured glass may be smooth in one texel and rough in another
    lost, lost_large = (_lose(uses) for uses in (found, wanted))
    wide, wide_large = (_spread(uses) for uses in (found, wanted))
    # Which lights, by way of what, what becomes of it, in words
    rows = (
        (followed, wanted, "simulated", "{light} by way of {things}, found from the lamp's side where it falls on "
                                        "diffuse surfaces"),
        (followed, small, "noisy", "{light} by way of small {things}; few light paths meet it"),
        ([each for each in met if each in followed], wanted, "noisy",
         "{light} that such surfaces show in mirrors or through glass; camera paths meet the lamps by chance"),
        ([each for each in points if each in followed], wanted if wide_large else (), "noisy",
         "{light} that such surfaces show in mirrors or through glass; without extent, found only through narrow "
         "lobes"),
        ([each for each in points if each in followed], lost_large, "left out",
         "{light} that passes {things} and is seen through smooth glass again; without extent, no path meets it"),
        ([each for each in met if each not in followed], found, "noisy",
         f"{{light}} by way of {{things}}; camera paths meet it by chance{why}"),
        ([each for each in points if each not in followed], wide, "noisy",
         f"{{light}} by way of {{things}}; without extent, found only through narrow lobes{why}"),
        ([each for each in points if each not in followed], lost, "left out",
         f"{{light}} by way of {{things}}; without extent, no path from the camera meets it through smooth glass{why}"),
        (light.lights, short, "left out", "{light} by way of {things}; paths of {depth} edges are too short"),
    )
    return [(choice, how.format(light=kinds(lights), things=names([use.name for use in things]), depth=light.depth))
            for lights, things, choice, how in rows if lights and things]
