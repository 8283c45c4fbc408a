"""How far light gets: which lights of a pass can reach the object, and how long paths have to be.

Only lights that contribute exactly nothing are left out. Path lengths follow from the light that longer ones would
bring to the pictures, which `light_left` estimates by paths of its own. There is a bound without any estimate, too:
radiance is L = E + T L with emission E and transport T, and paths of at most n edges add up E + T E + ... + T^(n-1) E.
They leave out T^(n-1) L of the light that arrives at the first surface, at most a^(n-1) of all light, where a bounds
what one scattering event leaves (J. Arvo, K. Torrance, B. Smits, "A Framework for the Analysis of Error in Global
Illumination Algorithms", SIGGRAPH 1994): the largest reflectance of any material in the scene, for light from
everywhere, in its brightest channel and texel. That is one of energy over the scene, not of a picture, and no use where
glass or fog takes next to nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, log

import numpy as np

from dataset_builder.assets.asset import is_pane, is_solid
from dataset_builder.label.scene_plan import FogPlan, IlluminationPlan, LightPlan, Vector
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.light_left import MAX_DEPTH, LightLeft
from dataset_builder.planning.effects.materials_used import MaterialUse, is_smooth
from dataset_builder.planning.scene.shell import Reach, Shell

MIN_DEPTH, UNKNOWN_DEPTH = 3, 64
"""Least number of edges, and the largest where no path that planning traces finds light."""


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
    """Largest share of the light that longer paths would bring."""
    kept: bool
    """Whether that is as little as was asked for."""
    reason: str
    """In words."""


def needed_depth(share: float, bias: float) -> int:
    """Least number of edges n >= 2 with share^(n-1) <= bias; no more than one beyond MAX_DEPTH."""
    if share <= bias:
        return 2
    if share >= 1:
        return MAX_DEPTH + 1
    depth = min(ceil(log(bias) / log(share)) + 1, MAX_DEPTH + 1)
    # Logarithms round
    return depth + 1 if depth <= MAX_DEPTH and share ** (depth - 1) > bias else depth


def bends(materials: Sequence[MaterialUse]) -> bool:
    """Whether paths need edges to get through glass: solid, or panes that are rough somewhere."""
    return any(is_solid(use.material) or (is_pane(use.material) and not is_smooth(use.roughest)) for use in materials)


def path_depth(asked: int | str, bias: float, materials: Sequence[MaterialUse], fog: FogPlan,
               left: LightLeft) -> PathDepth:
    """The depth of a pass in which `materials` stand. asked: edges, or `auto` for what `bias` needs.

    The estimate decides. Without glass and fog the brightest material bounds the energy over the scene, too: its depth
    is enough where the estimate does not speak against it.
    """
    brightest = max(materials, key=lambda use: use.scattered)
    share, lossy = brightest.scattered, not bends(materials) and not fog.extinction
    depth = left.least(bias)
    if lossy and (known := needed_depth(share, bias)) <= MAX_DEPTH and (left.share[known] <= bias or not left.paths):
        depth = min(depth, known)
    depth = int(asked) if asked != "auto" else min(max(depth, MIN_DEPTH), MAX_DEPTH if left.paths else UNKNOWN_DEPTH)
    estimated, most = float(left.share[min(depth, MAX_DEPTH)]), float(left.bound[min(depth, MAX_DEPTH)])
    said, bound = [], most if left.paths else 1.0
    if left.paths:
        said.append(f"of the light of its pictures, longer paths bring about {estimated:.2g}, at most {most:.2g} "
                    f"(estimated from {left.paths:,} paths, 99.9% bound)")
    else:
        said.append("no path that planning traced found light")
    if lossy and share ** (depth - 1) < bound:
        bound = share ** (depth - 1)
        said.append(f"{brightest.name} scatters at most {share:.3g} of the light, which leaves out at most {bound:.2g} "
                    "of that of the scene")
    if asked != "auto":
        said.insert(0, "requested")
    elif bound > bias:
        said.append(f"cut at {depth}, a bias of {bias:g} would need longer ones")
    return PathDepth(depth=depth, left_out=bound, kept=bound <= bias, reason="; ".join(said))
