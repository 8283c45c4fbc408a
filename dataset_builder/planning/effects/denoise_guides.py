"""What denoising needs beside the noisy layer, and on which pixels: layers without noise that show the same edges."""

from dataset_builder.label.example_plan import RenderPlan
from dataset_builder.layers import LAYERS, Extent

ALBEDO = {"i_s": "d", "i_t": "d"}
"""Layers that carry the colour of the surface, and what shows it. Lighting carries none."""

NORMAL = {"3dm": "normal", "r3dm": "normal_rough"}
FACTOR = 16
"""How many times the dataset's spp a reference has that denoised layers are measured against: a quarter of the noise.
"""
REPEATS = 2
"""Independent renders of such an example as the dataset asks: their products hold the bias without the noise."""
MASKS = {"3dm": ("mask",), "r3dm": ("mask", "mask_rough")}
"""By geometry: where a layer of extent `object` lives is where any of these is above 0."""


def guides_of(name: str) -> tuple[str, ...]:
    """Layers that guide the denoising of one, masks aside."""
    normal = NORMAL[LAYERS[name].geometry]
    return (ALBEDO[name], normal) if name in ALBEDO else (normal,)


def guide_extents(render: RenderPlan) -> dict[str, Extent]:
    """Layers that denoising needs, shipped or not, and where: on the frame where a layer is denoised there."""
    extents, wanted = dict(render.layers), dict[str, Extent]()
    for name in render.denoise:
        for guide in guides_of(name):
            wanted[guide] = "frame" if "frame" in (extents[name], wanted.get(guide)) else "object"
        for mask in MASKS[LAYERS[name].geometry]:
            wanted.setdefault(mask, "object")
    return wanted
