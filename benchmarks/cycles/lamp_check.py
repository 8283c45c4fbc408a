"""Do both sides mean the same light? One scene under each kind of lamp, its mean image on both sides."""

import tempfile
from pathlib import Path
from typing import get_args

import _common as common
import numpy as np
from cycles.client import Blender
from cycles.contenders import Cycles, Ours, Setting

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS, LampName

KINDS = get_args(LampName)
BOUND = 0.02
SETTING = Setting(adaptive=False, denoise=False, knob=256)
SIZE, CUTOFF, RADIANCE = 0.3, 50.0, 10.0


def under(plan: ExamplePlan, kind: LampName) -> ExamplePlan:
    """The plan with one lamp of a kind in place of its target lights, aimed at the object."""
    first = next(light for light in plan.target_light.lights if light.kind in KINDS)
    aim = np.array(plan.target.position) - np.array(first.position)
    changed = {"kind": kind, "direction": tuple((aim / np.linalg.norm(aim)).tolist()),
               "size": SIZE if LIGHT_KINDS[kind].sized else 0.0, "cutoff": CUTOFF if LIGHT_KINDS[kind].beamed else 0.0,
               "radiance": (RADIANCE, RADIANCE / 2, RADIANCE / 4), "weight": 1.0}
    lights: tuple[LightPlan, ...] = (first.model_copy(update=changed),)
    passes = tuple(entry.model_copy(update={"lights": (0,)}) if entry.name in ("target", "rough") else entry
                   for entry in plan.effects.passes)
    return plan.model_copy(update={"target_light": plan.target_light.model_copy(update={"lights": lights}),
                                   "effects": plan.effects.model_copy(update={"passes": passes})})


class _Under(Ours):
    """Ours, with the lamp changed."""

    kind: LampName = KINDS[0]

    def plan(self, setting: Setting, seed: int) -> ExamplePlan:
        """The example's plan under one lamp of the kind."""
        return under(super().plan(setting, seed), self.kind)


def print_lamp_check(blender: Blender, example: int, size: int) -> int:
    """Ratios of means of I_s (dome and sun) and I_t, Cycles over ours; exit code 1 where one is beyond the bound."""
    ours, ratios = _Under(example, size, common.MINI.parent), {}
    for kind in KINDS:
        ours.kind = kind
        with tempfile.TemporaryDirectory() as folder:
            cycles = Cycles(blender, ours.plan(SETTING, 1), common.MINI.parent, Path(folder))
        theirs, mine = (side.shots(SETTING, 1)[0] for side in (cycles, ours))
        ratios |= {layer: float(theirs[name].image.mean() / mine[name].image.mean())
                   for layer, name in (("dome and sun", "i_s"), (kind, "i_t"))}
    for name, ratio in ratios.items():
        print(f"{name:13} mean image, Cycles over ours: {ratio:.4f} (bound 1 +- {BOUND:g})")
    return 0 if all(abs(ratio - 1) <= BOUND for ratio in ratios.values()) else 1
