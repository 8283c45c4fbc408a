"""Which fields examples need, and what these must meet: from the spec and its objects alone, before examples are
planned."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

from dataset_builder.errors import PlanError
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.catalogue import ExampleRef, PairRef
from dataset_builder.planning.field_recipe import field_plan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.things import target_plan
from dataset_builder.spec.field import FieldSpec


@dataclass(frozen=True, kw_only=True)
class FieldNeed:
    """One field that an example needs and that is to be made, as its plan will have it."""

    object: ObjectPlan
    field: FieldPlan
    asked: FieldSpec
    """What it must meet, among other things."""


def field_needs(planner: Planner, refs: Iterable[ExampleRef]) -> dict[ExampleRef, tuple[FieldNeed, ...]]:
    """The fields of each example, of those that need any; none of examples whose field cannot be planned, which nothing
    can be made of.

    Raises PlanError where splits share an object or a scene.
    """
    known, found = dict[tuple[PairRef, int], tuple[FieldNeed, ...]](), dict[ExampleRef, tuple[FieldNeed, ...]]()
    if not planner.loaded.dataset.fields:
        return found
    for ref in refs:
        key = ref.view.pair, ref.level
        if key not in known:
            known[key] = _needs(planner, *key)
        if known[key]:
            found[ref] = known[key]
    return found


def _needs(planner: Planner, pair: PairRef, level: int) -> tuple[FieldNeed, ...]:
    spec = planner.loaded.dataset
    split = spec.split_of(pair.split)
    rough = split.levels(spec.rough)[level]
    asked = dict.fromkeys([*((split.source,) if split.source.image else ()),
                           *((rough,) if isinstance(rough, FieldSpec) else ())])
    contents = planner.contents[pair.split]
    with suppress(PlanError):
        target = target_plan(planner.loaded, contents, pair) if asked else None
        plans = [(each, field_plan(spec, each, pair, target, planner.loaded.path.parent))
                 for each in asked if target is not None]
        return tuple(FieldNeed(object=target, field=plan, asked=each) for each, plan in plans
                     if target is not None and plan.kind != "own")
    return ()
