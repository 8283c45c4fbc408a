"""Caustics: what gathers light in a scene, and how well the paths of a pass find what it throws on other surfaces.

*simulated* is said only of light that a lamp sends through glass or off metal onto a diffuse surface and that light
paths follow. All else is found by chance, *noisy*, or not at all, *left out*.
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
REFLECTED, REFRACTED = 3, 4
"""Edges from the camera to a surface and on to a lamp by way of a mirror, and in and out of glass."""
Finding = tuple[str, str]
"""A choice and its reason."""


def casters(light: PassLight) -> tuple[MaterialUse, ...]:
    """What gathers light in a pass, and is within reach of its paths."""
    return tuple(use for use in light.materials if gathers(use.material) and _edges(use) <= light.depth)


def throws_caustics(light: PassLight) -> bool:
    """Whether lamps shine in a pass and something gathers their light."""
    return bool(light.lamps and casters(light))


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


def _findings(light: PassLight, transport: Transport) -> list[Finding]:
    gathering = [use for use in light.materials if gathers(use.material)]
    if not gathering:
        return [("none", "no smooth solid glass and no polished metal or coat is in the scene")]
    found = casters(light)
    short = [use for use in gathering if use not in found]
    followed = light.lamps if transport == "joined" else ()
    met = [each for each in light.lights if LIGHT_KINDS[each.kind].extended]
    points = [each for each in light.lights if each not in met]
    # Textured glass may be smooth in one texel and rough in another
    lost = [use for use in found if is_solid(use.material) and is_smooth(use.smoothest)]
    wide = [use for use in found if not (is_solid(use.material) and is_smooth(use.roughest))]
    # Which lights, by way of what, what becomes of it, in words
    rows = (
        (followed, found, "simulated", "{light} by way of {things}, found from the lamp's side where it falls on "
                                       "diffuse surfaces"),
        ([each for each in met if each in followed], found, "noisy",
         "{light} that such surfaces show in mirrors or through glass; camera paths meet the lamps by chance"),
        ([each for each in points if each in followed], found if wide else [], "noisy",
         "{light} that such surfaces show in mirrors or through glass; without extent, found only through narrow "
         "lobes"),
        ([each for each in points if each in followed], lost, "left out",
         "{light} that passes {things} and is seen through smooth glass again; without extent, no path meets it"),
        ([each for each in met if each not in followed], found, "noisy",
         "{light} by way of {things}; camera paths meet it by chance"),
        ([each for each in points if each not in followed], wide, "noisy",
         "{light} by way of {things}; without extent, found only through narrow lobes"),
        ([each for each in points if each not in followed], lost, "left out",
         "{light} by way of {things}; without extent, no path from the camera meets it through smooth glass"),
        (light.lights, short, "left out", "{light} by way of {things}; paths of {depth} edges are too short"),
    )
    return [(choice, how.format(light=kinds(lights), things=names([use.name for use in things]), depth=light.depth))
            for lights, things, choice, how in rows if lights and things]
