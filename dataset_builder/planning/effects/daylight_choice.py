"""Whether light samples of a dome go through the openings of a room, or all round."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.label.example_plan import Decision
from dataset_builder.label.scene_plan import LightPlan, PortalPlan, Vector
from dataset_builder.planning.scene.shell import Shell

LEAST_SHARE = 0.05
"""Of a pass's direct light that its dome must bring. In passes of the mini dataset portals left 0.59 to 0.88 of error x
time above, 0.71 to 1.11 from there down to 2%, and 1.10 on average where it brought less. Under images of a sky they
left 0.15 to 0.42, but up to 1.39 where that had a sun, which planning does not see."""


def daylight(name: str, lights: Sequence[LightPlan], shell: Shell, opened: Sequence[str],
             near: Vector) -> tuple[tuple[PortalPlan, ...], list[Decision]]:
    """The openings that light samples of a pass's dome go through, none for all round, with the reason; no decision
    where no dome shines. lights: those of the pass; opened: parts taken out of their way; near: where the target
    stands.
    """
    domes = [light for light in lights if light.kind == "dome" and light.weight > 0]
    if not domes:
        return (), []
    if any(light.image for light in domes):
        return (), [_all_round(name, "samples of an image follow what is bright in it")]
    share = sum(light.weight for light in domes) / sum(light.weight for light in lights)
    if share < LEAST_SHARE:
        why = f"the dome brings {share:.2g} of the direct light, too little for openings to pay"
        return (), [_all_round(name, why)]
    found = shell.openings(opened, np.asarray(near))
    if not found.portals:
        return (), [_all_round(name, found.why)]
    return found.portals, [Decision(effect=f"daylight of {name}", choice="through openings",
                                    reason=f"sampled through {found.why}")]


def _all_round(name: str, why: str) -> Decision:
    return Decision(effect=f"daylight of {name}", choice="all round", reason=why)
