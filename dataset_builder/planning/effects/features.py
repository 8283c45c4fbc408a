"""What surfaces and air of a scene need: the features that rendering kernels are compiled with, with reasons."""

from collections.abc import Callable, Sequence
from typing import get_args

from dataset_builder.assets.asset import (
    Material,
    coverage_range,
    disperses,
    is_mapped,
    is_pane,
    is_solid,
    range_of,
    sends,
)
from dataset_builder.assets.glass_bodies import fill_of, glass_bodies
from dataset_builder.label.example_plan import Decision, Feature, RenderPlan
from dataset_builder.label.scene_plan import FogPlan
from dataset_builder.planning.effects.materials_used import MaterialUse, SceneUse

NAMED = 3
"""How many materials a reason names before it counts the rest."""


def _glossy(material: Material) -> bool:
    return material.specular > 0 or material.metallic > 0 or material.coat > 0 or material.transmission > 0


_CALLS: dict[Feature, tuple[Callable[[Material], bool], str]] = {
    "textures": (lambda material: material.texture is not None, "has a texture"),
    "maps": (is_mapped, "has a texture with further maps, ends or square texels"),
    "specular": (_glossy, "is glossy"),
    "coat": (lambda material: range_of(material, "coat")[1] > 0, "has a clear coat"),
    "sheen": (lambda material: range_of(material, "sheen")[1] > 0, "has sheen"),
    "glass": (is_solid, "is solid glass"),
    "thin": (is_pane, "is thin glass"),
    "dispersion": (disperses, "is glass with an Abbe number"),
    "nested": (lambda material: fill_of(material) is not None, "is solid glass with a priority"),
    "coverage": (lambda material: coverage_range(material)[0] < 1, "is cut out or there in part"),
    "emission": (sends, "sends out light"),
}
"""What a material must be to call for a feature, and how to say so."""
_OWN: dict[Feature, Callable[[MaterialUse], bool]] = {
    "colours": lambda use: use.coloured, "coverage": lambda use: use.coverage[0] < 1}
"""What vertices call for."""
_COSTS: dict[Feature, str] = {
    "coverage": "sight and light go straight on past what is not there, which takes a ray each time; cameras and "
                "target lights are placed as if all of it were there",
    "nested": "of what several take the highest priority owns; camera paths count the bodies that they are in",
    "emission": "paths meet it by chance, so what is small and bright is noisy; target lights are placed without it",
}
"""What else there is to say of a feature that is on."""


def names(uses: Sequence[str]) -> str:
    """The first few names, and how many more there are."""
    more = len(uses) - NAMED
    return ", ".join(uses[:NAMED]) + (f" and {more} more" if more > 0 else "")


def scene_features(use: SceneUse, fog: FogPlan, render: RenderPlan,
                   taken: bool = False) -> tuple[tuple[Feature, ...], tuple[Decision, ...]]:
    """The features that a scene calls for, in the order of `Feature`, and the decisions about its surfaces and air.
    taken: whether the R3DM is taken from a field, which gives it vertices with colours. Raises PlanError where more
    bodies of glass know each other than paths can count."""
    glass_bodies([each.material for each in use.materials])
    calling = {feature: [each for each in use.materials if _calls(feature, each)]
               for feature in get_args(Feature) if feature in {*_CALLS, *_OWN}}
    on = {feature for feature, found in calling.items() if found} | ({"fog"} if fog.extinction > 0 else set())
    on |= {"colours"} if taken else set()
    features = tuple(feature for feature in get_args(Feature) if feature in on)
    decisions = [_said(feature, found, len(use.materials)) for feature, found in calling.items()
                 if feature not in ("textures", "dispersion", *(() if calling["glass"] else ("nested",)))]
    if taken:
        decisions = [each for each in decisions if each.effect != "colours"] + [Decision(
            effect="colours", choice="on", reason="the rough mesh is taken from a field, in the colours seen there")]
    return features, (_textures(calling["textures"], render), *decisions, *_unowned(use), *_idle(use),
                      _dispersion(calling["dispersion"]), _fog(fog), *_nowhere(use), _normals(use), *_files(use))


def _calls(feature: Feature, use: MaterialUse) -> bool:
    own = feature in _OWN and _OWN[feature](use)
    return own or (feature in _CALLS and _CALLS[feature][0](use.material))


def _said(feature: Feature, found: Sequence[MaterialUse], count: int) -> Decision:
    what = _CALLS[feature][1] if feature in _CALLS else "has vertices with colours"
    if not found:
        return Decision(effect=feature, choice="off", reason=f"none of the {count} materials in the scene {what}")
    about = f"{len(found)} of {count} materials: {names([each.name for each in found])}"
    return Decision(effect=feature, choice="on",
                    reason=f"{about}; {_COSTS[feature]}" if feature in _COSTS else about)


def _unowned(use: SceneUse) -> list[Decision]:
    """Glass in glass that nobody said anything about."""
    if not use.unowned:
        return []
    return [Decision(effect="nested", choice="no owner", reason="bodies of glass take the same space or touch, and no "
                     f"priority says which owns it: {names(use.unowned)}; each is traced as if air were around it (give"
                     " the materials a different `priority`, the outermost the highest)")]


def _idle(use: SceneUse) -> list[Decision]:
    """What materials say of glass where nothing is glass."""
    metal = [each.name for each in use.materials if range_of(each.material, "transmission")[1] > 0
             and not (is_solid(each.material) or is_pane(each.material))]
    loose = [each.name for each in use.materials if (each.material.priority or each.material.abbe)
             and not is_solid(each.material)]
    said = (("glass", metal, "transmission is not honoured, since metal lets no light through: {} (set `metallic: 0`"
                             " beside `transmission`)"),
            ("nested", loose, "`priority` and `abbe` are not honoured, since these are no solid glass: {}"))
    return [Decision(effect=effect, choice="not honoured", reason=why.format(names(found)))
            for effect, found, why in said if found]


def _nowhere(use: SceneUse) -> list[Decision]:
    """Things of which nothing can be seen."""
    owners = dict.fromkeys(each.owner for each in use.materials if each.part == "furniture")
    gone = [owner for owner in owners if not any(each.coverage[1] for each in use.materials if each.owner == owner)]
    if not gone:
        return []
    return [Decision(effect="coverage", choice="nothing there",
                     reason=f"alpha is 0, or below its cutoff, everywhere on {names(gone)}")]


def _textures(found: Sequence[MaterialUse], render: RenderPlan) -> Decision:
    textures = {id(each.material.texture): each.material.texture for each in found}.values()
    if not textures:
        return Decision(effect="textures", choice="off", reason="no material in the scene has one")
    sizes = [texture.base_color.shape[:2] for texture in textures if texture is not None]
    texels, largest = sum(height * width for height, width in sizes), max(max(size) for size in sizes)
    limit = (f"downsampled to {render.texture_size} texels per side" if largest > render.texture_size
             else f"all within {render.texture_size} texels per side")
    if render.texels_per_pixel:
        limit += f", and to {render.texels_per_pixel:g} per pixel where the camera is nearest"
    return Decision(effect="textures", choice=f"{len(sizes)}",
                    reason=f"{texels:,} texels, {limit}: {names([each.name for each in found])}")


def _dispersion(found: Sequence[MaterialUse]) -> Decision:
    if not found:
        return Decision(effect="dispersion", choice="off", reason="no solid glass with an Abbe number is in the scene; "
                        "colours are RGB")
    named = names([f"{each.name} (Abbe number {each.material.abbe:.3g})" for each in found])
    return Decision(effect="dispersion", choice="on", reason=f"three wavelengths, one per colour channel, for {named}")


def _fog(fog: FogPlan) -> Decision:
    if not fog.extinction:
        return Decision(effect="fog", choice="off", reason="the air is clear: the scene has no medium")
    return Decision(effect="fog", choice="on", reason=f"a homogeneous medium of extinction {fog.extinction:.3g} per "
                    f"metre, albedo {fog.albedo:.3g} and anisotropy {fog.anisotropy:.3g} fills the room")


def _normals(use: SceneUse) -> Decision:
    if not use.smooth:
        return Decision(effect="normals", choice="flat", reason="every edge in the scene is a crease or in a plane")
    flat = f"; flat: {names(use.flat)}" if use.flat else ""
    return Decision(effect="normals", choice="smooth", reason=f"curved: {names(use.smooth)}{flat}")


def _files(use: SceneUse) -> list[Decision]:
    return [*(Decision(effect="scene file", choice=choice, reason=about) for choice, about in use.scene),
            *(Decision(effect="mesh file", choice=choice, reason=about) for choice, about in use.files)]
