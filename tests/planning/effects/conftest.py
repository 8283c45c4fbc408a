"""Effects of a scene of boxes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.label.example_plan import EffectsPlan
from dataset_builder.label.scene_plan import FogPlan, IlluminationPlan, LightPlan, RoomPlan
from dataset_builder.planning.effects.decisions import plan_effects
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.spec.render import RenderSpec
from tests import plans
from tests.planning.effects.decided import MATTE, lamp, placed

PAPER = (("i_s", "frame"), ("d", "object"), ("r", "object"), ("i_t", "object"), ("s_prime", "object"),
         ("mask", "object"))


@pytest.fixture
def decide(monkeypatch: pytest.MonkeyPatch, room_of: Callable[..., RoomPlan]) -> Callable[..., EffectsPlan]:
    """Effects of a grey box, changed by figures, in a closed room; everything else on demand."""

    def make(target: dict[str, float] | None = None, others: tuple[dict[str, float], ...] = (), *,
             room: dict[str, Any] | None = None, lights: tuple[LightPlan, ...] = (lamp("area"),), fog: float = 0.0,
             albedo: float = 0.9,
             layers: tuple[tuple[str, str], ...] = PAPER, opened: tuple[str, ...] = ("ceiling", "walls"),
             **spec: Any) -> EffectsPlan:
        render = plans.example_plan(layers=layers).render
        furniture = tuple(placed(3 + k, **figures) for k, figures in enumerate(others))
        plan = room_of().model_copy(update=room or {})
        return plan_effects(
            spec=RenderSpec.model_validate(spec), room=plan, shell=BoxShell(plan), camera=plans.example_plan().camera,
            target=placed(1, **(target or MATTE)), furniture=furniture,
            source_light=IlluminationPlan(lights=(lamp("dome"),), open=opened),
            target_light=IlluminationPlan(lights=lights, open=()), fog=FogPlan(extinction=fog, albedo=albedo),
            render=render, mesh_root=Path())

    return make
