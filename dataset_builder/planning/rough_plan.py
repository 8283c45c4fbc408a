"""How the rough twin of an example is made: every number of its steps drawn, each from a path of its own."""

from functools import partial
from math import hypot
from typing import Any

from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.rough_base import bounding_radius
from dataset_builder.geometry.rough_steps import needed_rounds
from dataset_builder.geometry.support import NEAR, REACH, near_support
from dataset_builder.label.example_plan import RoughPlan, RoughStep
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import Param
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.seeding import derive_seed, rng
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.rough import Level, RoughSpec, Step, WhiteStep
from dataset_builder.spec.rough_levels import shortest, step_length, steps_at

NOISE = ("white", "field", "scanlines")
"""Steps with a standard deviation."""


def rough_of_field(spec: DatasetSpec, ref: ExampleRef, field: FieldPlan) -> RoughPlan:
    """How the rough mesh of an example is made that is taken from a field."""
    path = (*ref.view.path, "rough", ref.level)
    name = "own" if field.kind == "own" else f"{field.kind}-{field.views}-{field.resolution}"
    return RoughPlan(edge_length=0.0, rounds=0, crease_angle=spec.rough.crease_angle, sigma=0.0, level=ref.level,
                     direction="normal", seed=str(derive_seed(spec.seed, *path, "noise")), name=name, field=field)


def rough_plan(spec: DatasetSpec, ref: ExampleRef, level: Level, clean: TriangleMesh) -> RoughPlan:
    """How the rough mesh of an example is made by noise. clean: its 3DM, in the object's frame.

    Edge length is drawn per object, everything else per view and level.
    """
    pair, rough, path = ref.view.pair, spec.rough, (*ref.view.path, "rough", ref.level)
    written = steps_at(level)
    plain = not isinstance(level, (str, tuple))
    steps = tuple(_drawn(step, partial(rng, spec.seed, *path, "step", number)) for number, step in enumerate(written))
    sigma = draw(level, rng(spec.seed, *path, "sigma")) if plain else _sigma(steps)  # type: ignore[arg-type]
    edge_length = _edge_length(rough, written, clean, partial(rng, spec.seed, pair.split, "object", pair.object))
    white = plain or any(isinstance(step, WhiteStep) for step in written)
    # Noise of neighbours that move alike needs no mesh of one fineness: a scan stays as it is
    rounds = rough.rounds if white else needed_rounds(clean, edge_length=edge_length, rounds=rough.rounds)
    bumps = [step["height"] for step in steps if step.kind == "bumps"]
    near = near_support(clean, max([REACH * sigma, *bumps]) * bounding_radius(clean))
    return RoughPlan(edge_length=edge_length, rounds=rounds, crease_angle=rough.crease_angle, sigma=sigma,
                     level=ref.level, direction=rough.direction, seed=str(derive_seed(spec.seed, *path, "noise")),
                     name=level if isinstance(level, str) else "", steps=steps, triangles=rough.triangles,
                     coarsen=rough.coarsen and white, above_support=near > NEAR)


def _drawn(step: Step, stream: Any) -> RoughStep:
    fields = {name: getattr(step, name) for name in type(step).model_fields if name not in ("kind", "along")}
    values = tuple(Param(name=name, value=draw(value, stream(name))) for name, value in fields.items())
    return RoughStep(kind=step.kind, along=getattr(step, "along", "isotropic"), values=values)  # type: ignore[arg-type]


def _sigma(steps: tuple[RoughStep, ...]) -> float:
    """Standard deviation of independent noise that is added."""
    return hypot(*(step["sigma"] for step in steps if step.kind in NOISE))


def _edge_length(rough: RoughSpec, steps: tuple[Step, ...], clean: TriangleMesh, stream: Any) -> float:
    """Metres: as asked for, but in steps no longer than their shortest length, unless `edge` says so."""
    if rough.edge is not None:
        return draw(rough.edge, stream("edge")) * bounding_radius(clean)
    asked, needed = draw(rough.edge_length, stream("edge_length")), shortest(steps)
    return asked if needed is None else min(asked, needed * bounding_radius(clean))


def rough_notes(plan: RoughPlan, clean: TriangleMesh) -> tuple[str, ...]:
    """What a reader of the plan should know about the rough mesh."""
    notes = []
    if plan.above_support:
        notes.append("rough mesh: noise is mirrored up at the support, since much of the object lies close above it")
    shorter = [step.kind for step in plan.steps if (length := step_length(step.kind, step.__getitem__)) is not None
               and length * bounding_radius(clean) < (1 - 1e-9) * plan.edge_length]
    if shorter:
        notes.append(f"rough mesh: edges of {plan.edge_length:.3g} m are too long for all of {', '.join(shorter)}; "
                     "lower rough.edge")
    return tuple(notes)
