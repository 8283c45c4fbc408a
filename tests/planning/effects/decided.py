"""Lamps, boxes and effects of the tests of what is decided to be simulated."""

from collections.abc import Callable

from dataset_builder.label.example_plan import EffectsPlan
from dataset_builder.label.scene_plan import LightPlan, MaterialChange, ObjectPlan, Param, PlacedObject
from tests import plans

MATTE = {"specular": 0.0, "base_color.0": 0.5, "base_color.1": 0.5, "base_color.2": 0.5}
GLASS = {"transmission": 1.0, "roughness": 0.0, "specular": 0.04}
Decide = Callable[..., EffectsPlan]


def lamp(kind: str, radiance: float = 1.0) -> LightPlan:
    return plans.light_plan(kind, (radiance,) * 3)


def placed(number: int, **values: float) -> PlacedObject:
    change = MaterialChange(name="*", values=tuple(Param(name=key, value=value) for key, value in values.items()))
    plan = ObjectPlan(name=f"box-{number}", kind="procedural", source="chair", source_sha256="", category="chair",
                      licence="CC0-1.0", seed="0", params=(), materials=(change,), scale=1.0, up="z")
    return PlacedObject(object=plan, instance=number, position=(0.3 * (number - 1), 0, 0), yaw=0)


def choices(effects: EffectsPlan, effect: str) -> list[str]:
    return [decision.choice for decision in effects.decisions if decision.effect == effect]


def reason(effects: EffectsPlan, effect: str) -> str:
    return " ".join(decision.reason for decision in effects.decisions if decision.effect == effect)
