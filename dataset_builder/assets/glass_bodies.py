"""Bodies of glass that know each other: what fills them, and which of two owns the space that both take."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.assets.asset import Material, is_solid
from dataset_builder.errors import PlanError

MOST_BODIES = 5
"""Of one scene: a path counts each of them, and has room for no more."""


@dataclass(frozen=True, kw_only=True, order=True)
class GlassBody:
    """What fills bodies of glass. The order is that of ownership: the last one owns what several take."""

    priority: int
    """As the material has it, 1 or more."""
    ior: float
    abbe: float
    tint: tuple[float, float, float]
    """What a view through all of it leaves: the base colour, with the mean of its texels."""


def fill_of(material: Material) -> GlassBody | None:
    """What a material fills; None where it bounds no solid glass, or has no priority."""
    if not (material.priority and is_solid(material)):
        return None
    texels = np.ones(3) if material.texture is None else material.texture.base_color.mean(axis=(0, 1), dtype=float)
    tint = np.asarray(material.base_color) * texels
    return GlassBody(priority=material.priority, ior=material.ior, abbe=material.abbe,
                     tint=(float(tint[0]), float(tint[1]), float(tint[2])))


def glass_bodies(materials: Sequence[Material]) -> tuple[GlassBody, ...]:
    """All that materials fill, each once, in the order of ownership. Raises PlanError where there are more than
    `MOST_BODIES`."""
    found = sorted({body for material in materials if (body := fill_of(material)) is not None})
    if len(found) > MOST_BODIES:
        named = ", ".join(dict.fromkeys(m.name for m in materials if fill_of(m) is not None))
        raise PlanError(f"materials: expected at most {MOST_BODIES} kinds of glass with a priority in a scene, got "
                        f"{len(found)} (give the same priority, ior, abbe and base_color to some of {named}, or "
                        "priority 0 to what touches no other glass)")
    return tuple(found)
