"""On which pixels each pass of an example runs, and which layers guide the denoising of others."""

from dataset_builder.label.example_plan import Decision, RenderPlan
from dataset_builder.layers import ALIKE, EVERYWHERE, LAYERS, Extent

ALBEDO = {"i_s": "d", "i_t": "d"}
"""Layers that carry the colour of the surface, and what shows it. Lighting carries none."""

NORMAL = {"3dm": "normal", "r3dm": "normal_rough"}
MASKS = {"3dm": ("mask",), "r3dm": ("mask", "mask_rough")}
"""By geometry: where a layer of extent `object` lives is where any of these is above 0."""


def guides_of(name: str) -> tuple[str, ...]:
    """Layers that guide the denoising of one, masks aside. Bounced light on the rough mesh is guided by the clean."""
    geometry = LAYERS[name].geometry
    normals = (NORMAL[geometry],) if geometry == "3dm" else (NORMAL[geometry], NORMAL["3dm"])
    return (ALBEDO[name], *normals) if name in ALBEDO else normals


def has_direct(render: RenderPlan) -> bool:
    """Whether denoising needs to know what of S' comes straight from the lights."""
    return "s_prime" in render.denoise


def guide_extents(render: RenderPlan) -> dict[str, Extent]:
    """Layers that denoising needs, shipped or not, and where: on the frame where a layer is denoised there."""
    extents, wanted = dict(render.layers), dict[str, Extent]()
    for name in render.denoise:
        for guide in guides_of(name):
            wanted[guide] = "frame" if "frame" in (extents[name], wanted.get(guide)) else "object"
        for mask in MASKS[LAYERS[name].geometry]:
            wanted.setdefault(mask, "object")
    return wanted


def asked_of(render: RenderPlan, name: str) -> dict[str, str]:
    """Layers of a pass and their extents."""
    return {layer: extent for layer, extent in render.layers if LAYERS[layer].render_pass == name}


def runs(render: RenderPlan, name: str) -> bool:
    """The first pass always runs: it finds the object's pixels; the rough one finds those of S'."""
    rough = name == "first_hit_rough" and bool(asked_of(render, "rough") or asked_of(render, "pbr"))
    return name == "first_hit" or rough or bool(asked_of(render, name))


def extent_of_pass(render: RenderPlan, name: str) -> tuple[str, str]:
    """On which pixels a pass runs, and why."""
    asked = asked_of(render, name)
    on_frame = [layer for layer, extent in asked.items() if extent == "frame" and layer not in EVERYWHERE]
    if on_frame:
        return "frame", f"requested on the whole frame: {', '.join(on_frame)}"
    guides = [layer for layer, extent in guide_extents(render).items()
              if extent == "frame" and layer not in EVERYWHERE and LAYERS[layer].render_pass == name]
    if guides:
        return "frame", f"guides what is denoised on the whole frame: {', '.join(guides)}"
    if asked and name in ALIKE[1:] and runs(render, ALIKE[0]) and extent_of_pass(render, ALIKE[0])[0] == "frame":
        return "frame", "as the pass target, whose random numbers it shares pixel by pixel"
    if asked:
        return "object", f"requested on the object only: {', '.join(asked)}"
    why = "none of its layers is requested"
    return "object", f"{why}, but it finds the object's pixels" if runs(render, name) else why


def light_free(render: RenderPlan) -> list[Decision]:
    """Layers that need no light."""
    free = [layer for layer, _ in render.layers if not LAYERS[layer].radiometric]
    clean = [layer for layer in free if LAYERS[layer].geometry == "3dm"]
    rough = [layer for layer in free if LAYERS[layer].geometry == "r3dm"]
    reasons = [f"once per view: {', '.join(clean)}"] * bool(clean)
    reasons += [f"once per light and noise level: {', '.join(rough)}"] * bool(rough)
    return [Decision(effect="light-free layers", choice=f"{len(free)} of {len(render.layers)}",
                     reason="; ".join(reasons) or "all requested layers need light")]


def most_spp(render: RenderPlan, name: str) -> int:
    """Samples of a pixel of a pass, or the largest cap of a goal."""
    caps = [goal.cap for goal in render.goals if LAYERS[goal.layer].render_pass == name]
    return max([sum(render.parts(name)), *caps])
