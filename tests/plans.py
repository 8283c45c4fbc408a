"""Plausible plans of examples, for tests that need one and do not care how it was planned."""

from typing import Any, get_args

from dataset_builder.label.example_label import PassRecord, RenderRecord
from dataset_builder.label.example_plan import EffectsPlan, ExamplePlan, PassEffects, RenderPlan, RoughPlan
from dataset_builder.label.scene_plan import (
    CameraPlan,
    IlluminationPlan,
    LightPlan,
    ObjectPlan,
    Param,
    PlacedObject,
    RoomPlan,
)
from dataset_builder.layers import PASSES, Pass

PAPER = (
    ("i_s", "frame"), ("d", "object"), ("r", "object"), ("i_t", "frame"), ("s_prime", "object"), ("mask", "object"),
)


def object_plan(name: str = "train-stool-00", category: str = "stool") -> ObjectPlan:
    """A piece of furniture of an embedded family."""
    return ObjectPlan(
        name=name, kind="procedural", source=category, source_sha256="", category=category, licence="CC0-1.0",
        seed="11400714819323198485", params=(Param(name="height", value=0.45), Param(name="radius", value=0.18)),
        scale=1.0, up="z",
    )


def light_plan(kind: str = "area", radiance: tuple[float, float, float] = (12.0, 10.0, 7.5)) -> LightPlan:
    """One emitter, two metres above the floor."""
    return LightPlan(kind=kind, position=(0.8, -0.4, 2.0), direction=(0.0, 0.0, -1.0), size=0.3, cutoff=0.0,
                     radiance=radiance, temperature=3200.0, weight=6.3)


def effects_plan(max_depth: int = 6) -> EffectsPlan:
    """Opaque surfaces under one light, on the object."""
    passes = tuple(PassEffects(name=name, extent="object", lights=(0,), max_depth=max_depth) for name in PASSES)
    return EffectsPlan(features=("textures", "specular"), passes=passes, decisions=())


def example_plan(index: int = 0, *, split: str = "train", view: str = "", light: int = 0, width: int = 8,
                 height: int = 6, sigma: float = 0.004, layers: tuple[tuple[str, str], ...] = PAPER) -> ExamplePlan:
    """The plan of example `index`: a stool and a cabinet in a small room, one lamp."""
    cabinet = PlacedObject(object=object_plan("train-cabinet-00", "cabinet"), instance=3, position=(1.4, 1.2, 0.0),
                           yaw=90.0)
    dome = light_plan("dome", (1.0, 1.0, 1.0))
    return ExamplePlan(
        schema_version="1", key=f"{index:08d}", index=index, split=split, view=view or f"{split}/{index:06d}",
        light=light,
        room=RoomPlan(name=f"{split}-room-00", seed="42", width=4.0, depth=3.5, height=2.6, ceiling=True, windows=1,
                      skirting=0.08),
        target=PlacedObject(object=object_plan(f"{split}-stool-00"), instance=1, position=(0.1, 0.2, 0.0), yaw=30.0),
        furniture=(cabinet,),
        camera=CameraPlan(position=(1.2, -1.3, 1.1), target=(0.1, 0.2, 0.25), up=(0.0, 0.0, 1.0), fov=45.0,
                          coverage=0.25, visibility=0.9),
        source_light=IlluminationPlan(lights=(dome,), open=("ceiling",)),
        target_light=IlluminationPlan(lights=(light_plan(),), open=()),
        rough=RoughPlan(edge_length=0.04, rounds=1, crease_angle=30.0, sigma=sigma, level=0, direction="isotropic",
                        seed="18446744073709551615"),
        render=RenderPlan(width=width, height=height, layers=layers, spp_first_hit=16, spp_source=16, spp_target=16,
                          spp_rough=16, batches=4, rr_depth=5, seed="7"),
        effects=effects_plan(),
        notes=("no transmission: no material has any",),
    )


def render_record(**figures: Any) -> RenderRecord:
    """A record of passes that traced nothing; `figures` are what a test cares about."""
    passes = tuple(PassRecord(name=name) for name in get_args(Pass))
    plain = {"passes": passes, "layers": (), "roughness_rms": 0.0, "roughness_max": 0.0, **figures}
    return RenderRecord.model_validate(plain)
