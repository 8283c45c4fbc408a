"""How far light gets: which lights of a pass can reach the object, and how long paths have to be.

Only lights that contribute exactly nothing are left out. Path lengths follow from a geometric bound on the light that
longer ones would add. Radiance is L = E + T L with emission E and transport T; paths of at most n edges add up
E + T E + ... + T^(n-1) E. What they leave out of the light that arrives at the first surface is T^(n-1) L, at most
a^(n-1) of all light, where a bounds what one scattering event leaves (J. Arvo, K. Torrance, B. Smits, "A Framework for
the Analysis of Error in Global Illumination Algorithms", SIGGRAPH 1994). Here a is the largest reflectance of any
material in the scene, for light from everywhere, in its brightest channel and texel. The bound is one of energy over
the scene, not of each pixel.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, exp, log

import numpy as np

from dataset_builder.assets.asset import is_pane, is_solid
from dataset_builder.label.scene_plan import FogPlan, IlluminationPlan, LightPlan, Vector
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.materials_used import MaterialUse, is_smooth
from dataset_builder.planning.scene.shell import Reach, Shell

MIN_DEPTH, MAX_DEPTH = 3, 64
SOLID_CROSSINGS, PANE_CROSSINGS = 8, 4
"""Edges added for glass, which takes next to nothing of what passes: two bodies (in and out) or two rough panes behind
each other, both on the way to a surface and on the way from it to the light. Smooth panes bend no path and add no
edge."""


def reach(light: LightPlan, shell: Shell, opened: Sequence[str], near: Vector) -> Reach:
    """Whether a light can bring anything to a target that stands at `near`, with the parts `opened` taken away."""
    if not any(light.radiance):
        return Reach(kept=False, why="sends nothing")
    if not LIGHT_KINDS[light.kind].outside:
        return Reach(kept=True, why=f"stands in the {shell.noun}")
    if there := [part for part in opened if part in shell.parts]:
        found = Reach(kept=True, why=f"enters where the {' and '.join(there)} {_verb(there)} removed")
    else:
        found = shell.lets_in(light, np.asarray(near))
    if lost := [part for part in opened if part not in shell.parts]:
        found = replace(found, why=f"{found.why} (the {shell.noun} has no {' and no '.join(lost)} to remove)")
    return found


def _verb(parts: Sequence[str]) -> str:
    return "are" if len(parts) > 1 or parts[0].endswith("s") else "is"


def reaching(illumination: IlluminationPlan, shell: Shell, near: Vector) -> tuple[Reach, ...]:
    """For each light of a pass whether it can reach a target that stands at `near`."""
    return tuple(reach(light, shell, illumination.open, near) for light in illumination.lights)


def said(lights: Sequence[LightPlan], found: Sequence[Reach]) -> str:
    """The reasons in one line; lights of one kind and one fate are counted together."""
    groups: dict[tuple[str, Reach], int] = {}
    for light, each in zip(lights, found, strict=True):
        groups[light.kind, each] = groups.get((light.kind, each), 0) + 1
    return "; ".join(f"{f'{count} of kind {kind}' if count > 1 else kind}{'' if each.kept else ' left out'}: {each.why}"
                     for (kind, each), count in groups.items())


@dataclass(frozen=True, kw_only=True)
class PathDepth:
    """Longest path of a pass."""

    depth: int
    """In edges."""
    left_out: float
    """Largest share of the light arriving at a surface that longer paths would bring."""
    reason: str
    """In words."""


def with_fog(share: float, fog: FogPlan, diagonal: float) -> float:
    """Largest share that one event leaves where light may also be scattered by fog, over ways up to `diagonal` metres.

    An event is in the fog with a probability p of at most 1 - exp(-extinction diagonal): p albedo + (1 - p) share.
    """
    in_fog = 1 - exp(-fog.extinction * diagonal)
    return max(share, share + in_fog * (fog.albedo - share))


def needed_depth(share: float, bias: float) -> int:
    """Least number of edges n >= 2 with share^(n-1) <= bias; no more than one beyond MOST."""
    if share <= bias:
        return 2
    if share >= 1:
        return MAX_DEPTH + 1
    depth = min(ceil(log(bias) / log(share)) + 1, MAX_DEPTH + 1)
    # Logarithms round
    return depth + 1 if depth <= MAX_DEPTH and share ** (depth - 1) > bias else depth


def crossings(materials: Sequence[MaterialUse]) -> int:
    """Edges that paths need beyond the bound, to get through glass."""
    solid = any(is_solid(use.material) for use in materials)
    panes = any(is_pane(use.material) and not is_smooth(use.roughest) for use in materials)
    return SOLID_CROSSINGS * solid + PANE_CROSSINGS * panes


def path_depth(asked: int | str, bias: float, materials: Sequence[MaterialUse], fog: FogPlan,
               diagonal: float) -> PathDepth:
    """The depth of a pass in which `materials` stand. asked: edges, or `auto` for what `bias` needs.

    diagonal: longest way in the fog, metres.
    """
    brightest = max(materials, key=lambda use: use.scattered)
    share, extra = with_fog(brightest.scattered, fog, diagonal), crossings(materials)
    through = f"; {extra} more edges pass through glass" if extra else ""
    event = f"{brightest.name} scatters at most {brightest.scattered:.3g} of the light"
    if share > brightest.scattered:
        event += f" and the fog {fog.albedo:.3g}, together {share:.3g}"
    if asked != "auto":
        depth = int(asked)
        left = min(share ** max(depth - 1 - extra, 0), 1.0)
        return PathDepth(depth=depth, left_out=left, reason=f"requested; {event}, so longer paths would add at most "
                         f"{left:.2g} of the light that arrives at a surface{through}")
    needed = max(needed_depth(share, bias), MIN_DEPTH)
    depth = min(needed + extra, MAX_DEPTH)
    left = share ** (depth - 1 - extra)
    said = f"{event}, so longer paths would add at most {left:.2g} of the light that arrives at a surface{through}"
    if needed + extra > MAX_DEPTH:
        said += f"; cut at {MAX_DEPTH}, a bias of {bias:g} would need longer ones"
    return PathDepth(depth=depth, left_out=left, reason=said)
