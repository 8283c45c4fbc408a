"""A quick look at an example before its dataset is built: few samples, a small picture, denoised where that can be."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dataset_builder.errors import UserError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.layers import Extent

if TYPE_CHECKING:
    import numpy as np

    from dataset_builder.spec.resolve import LoadedSpec

LAYERS_SHOWN: dict[str, Extent] = {"i_s": "frame", "i_t": "frame", "s_prime": "object"}
SIDE, SPP, FIRST_HIT_SPP = 160, 8, 4
"""Pixels along the longer side at most, and samples per pixel with and without light."""


@dataclass(frozen=True, kw_only=True, eq=False)
class QuickRender:
    """What was rendered, and how."""

    images: Mapping[str, "np.ndarray"] = field(default_factory=dict)
    """(H, W, 3) float32 by layer; none where nothing could be."""
    note: str = ""
    """That it is a preview, with what it is not."""
    missing: str = ""
    """Why something is not there."""


def quick_plan(plan: ExamplePlan, *, denoise: bool) -> tuple[ExamplePlan, tuple[str, ...]]:
    """The plan with fewer samples and pixels, and for i_s, i_t and S' alone; and why any of these is left out.

    Layers that the dataset does not have are left out without a word, as are accuracies and parts of spp.
    """
    scale = min(1.0, SIDE / max(plan.render.width, plan.render.height))
    waits = {"i_s": plan.field.made, "s_prime": plan.rough.field.made}
    asked = [name for name in LAYERS_SHOWN if name in dict(plan.render.layers)]
    layers = [name for name in asked if not waits.get(name)]
    render = plan.render.model_copy(update={
        "width": max(1, round(plan.render.width * scale)), "height": max(1, round(plan.render.height * scale)),
        "layers": tuple((name, LAYERS_SHOWN[name]) for name in layers), "spp_first_hit": FIRST_HIT_SPP,
        **{f"spp_{name}": SPP for name in ("source", "target", "rough")}, "spp_parts": (), "batches": 2, "goals": (),
        "denoise": tuple(layers) if denoise else (), "keep_raw": False})
    passes = tuple(each.model_copy(update={"extent": "object" if "rough" in each.name else "frame"})
                   for each in plan.effects.passes)
    left_out = tuple(f"{name} needs a neural field, which a build makes first" for name in asked if waits.get(name))
    return plan.model_copy(update={"render": render, "effects": plan.effects.model_copy(update={"passes": passes})}), \
        left_out


def quick_render(loaded: "LoadedSpec", plan: ExamplePlan, *, backend: str = "auto") -> QuickRender:
    """Render an example quickly. Raises nothing that a user could mend: `missing` says what it was."""
    from dataset_builder.api import render_example

    denoise = _denoiser()
    quick, left_out = quick_plan(plan, denoise=denoise)
    if not quick.render.layers:
        return QuickRender(missing="; ".join(left_out) or f"the dataset has none of {', '.join(LAYERS_SHOWN)}")
    try:
        found: dict[str, Any] = render_example(loaded, quick, backend=backend)
    except UserError as error:
        return QuickRender(missing="; ".join(map(str, error.problems)))
    return QuickRender(images={name: found[name] for name, _ in quick.render.layers}, missing="; ".join(left_out),
                       note=f"preview at {SPP} spp{', denoised' if denoise else ''}")


def _denoiser() -> bool:
    """Whether there is one."""
    from dataset_builder.rendering import oidn

    try:
        oidn.require()
    except UserError:
        return False
    return True
