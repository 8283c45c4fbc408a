"""Which passes an example needs, and what of its plan each of them depends on.

Two examples that agree in a pass's inputs share what it finds, whatever else their plans say: names, notes, places in
the dataset and layers that the pass does not make have no part in it. Nothing here renders.
"""

from collections import Counter, defaultdict
from math import pi
from typing import Any

from dataset_builder.digest import digest
from dataset_builder.label.example_plan import ExamplePlan, GoalPlan
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import IlluminationPlan, ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.layers import ALIKE, LAYERS, LIT, PASSES, Pass
from dataset_builder.planning.effects.pass_extents import has_direct
from dataset_builder.spec.model import Model

INSTANCE, LIGHTING, DIRECT = "instance", "lighting", "rough_direct"
"""Passes without a layer in the table of their own: what is met at pixel centres, the light around the object, and S'
without light that has bounced."""

DIRECT_DEPTH = 2
"""Edges of the longest path of `DIRECT`: from the camera to the object, and on to a light."""

ROUGH = ("first_hit_rough", "rough", "pbr")
"""Passes that trace the R3DM."""
RUNS = (*PASSES, INSTANCE, LIGHTING, DIRECT)
"""Everything that is rendered as a pass of its own."""

UNSEEN = frozenset({"name", "category", "licence", "coverage", "visibility", "temperature", "image"})
"""Fields of plans that no pixel depends on; images count by their content."""

Inputs = dict[str, Any]
"""What a pass depends on, by topic, as plain data. The topics are the words that people read."""


def needed_passes(plan: ExamplePlan) -> tuple[Pass, ...]:
    """The passes that the layers of an example need, in order; the first always, for it finds the object's pixels."""
    return tuple(name for name in PASSES if name == "first_hit" or asked(plan, name)
                 or (name == "first_hit_rough" and lights_rough(plan)))


def needs_lighting(plan: ExamplePlan) -> bool:
    """Whether an example has layers under its target illumination."""
    return any(asked(plan, name) for name in LIT if name != "source")


def lights_rough(plan: ExamplePlan) -> bool:
    """Whether the R3DM is seen under light."""
    return asked(plan, "rough") or asked(plan, "pbr")


def in_step(plan: ExamplePlan, name: str) -> bool:
    """Whether joined paths of a pass are kept in step with those of another one that the example has."""
    return (name in ALIKE and sum(asked(plan, each) for each in ALIKE) > 1
            and plan.effects.of(name).transport == "joined")


def compared_with(plan: ExamplePlan, name: str) -> Pass | None:
    """The pass whose light paths those of a pass are put beside, pixel by pixel. That with the R3DM has none: it runs
    for every noise level, and the others for all together."""
    pair: dict[str, Pass] = {"target": "empty", "empty": "target"}
    other = pair.get(name)
    if other is None or not in_step(plan, name) or not asked(plan, other):
        return None
    return other if plan.effects.of(name).extent == plan.effects.of(other).extent else None


def asked(plan: ExamplePlan, render_pass: Pass) -> bool:
    """Whether a layer of the example comes from a pass."""
    return any(LAYERS[name].render_pass == render_pass for name, _ in plan.render.layers)


def all_passes(plan: ExamplePlan) -> tuple[str, ...]:
    """Every pass that runs for an example, those without a layer in the table included."""
    instance = (INSTANCE,) if any(name == INSTANCE for name, _ in plan.render.layers) else ()
    lighting = (LIGHTING,) if needs_lighting(plan) else ()
    return (*needed_passes(plan), *instance, *lighting, *((DIRECT,) if has_direct(plan.render) else ()))


def steps_of(plan: ExamplePlan, name: str) -> int:
    """Steps that a pass is sampled in, each of which may be kept: goals that follow each other, else parts of spp."""
    if name in (INSTANCE, LIGHTING, DIRECT):
        return 1
    goals = Counter(goal.layer for goal in plan.render.goals if LAYERS[goal.layer].render_pass == name)
    return max(goals.values()) if goals else len(plan.render.parts(name))


def goals_at(plan: ExamplePlan, name: str, step: int) -> tuple[GoalPlan, ...]:
    """Goals of a pass's layers at one step; a layer that has fewer keeps its last."""
    by_layer = defaultdict[str, list[GoalPlan]](list)
    for goal in plan.render.goals:
        if LAYERS[goal.layer].render_pass == name:
            by_layer[goal.layer].append(goal)
    return tuple(goals[min(step, len(goals) - 1)] for goals in by_layer.values())


def sky_radiance(plan: ExamplePlan) -> float:
    """Radiance of white paper under the source light, nothing in the way: the unit of emission under every light. It is
    the source dome's radiance, or that of paper which faces the sun where there is no dome."""
    return plan.source_light.lights[0].weight / pi


def inputs_of(plan: ExamplePlan, name: str, steps: int | None = None) -> Inputs:
    """What the first `steps` (all of them by default) of the pass `name` of an example depend on."""
    if name == DIRECT:
        # Its samples are as many as that pass took
        return inputs_of(plan, "rough") | {"pass": name}
    found: Inputs = {"pass": name, "seed": plan.render.seed, "room": _room(plan.room), "object": _placed(plan.target),
                     "furniture": [_placed(placed) for placed in plan.furniture], "fog": _plain(plan.fog),
                     "effects": list(plan.effects.features), "texture size": plan.render.texture_size}
    if plan.render.texels_per_pixel:
        found["texels"] = [plan.render.texels_per_pixel, plan.render.width, plan.render.height, _plain(plan.camera)]
    if "emission" in plan.effects.features and name in (*LIT, LIGHTING):
        found["emission"] = sky_radiance(plan)
    if name == LIGHTING:
        return found | _light(plan, "target") | {"path length": _path_length(plan, "target"),
                                                 "openings": _openings(plan, "target")}
    found |= {"camera": _plain(plan.camera), "image size": [plan.render.width, plan.render.height]}
    if name == INSTANCE:
        return found
    samples = _samples(plan, name, steps_of(plan, name) if steps is None else steps)
    found |= {"pixels": plan.effects.of(name).extent, "samples": samples}
    if name == "source" and plan.field.there:
        # Seen alone: nothing of the room, its light or its passes matters
        return {key: found[key] for key in ("pass", "seed", "object", "camera", "image size", "samples")} | {
            "field": _plain(plan.field), "sky": sky_radiance(plan)}
    if name in ROUGH:
        found["rough mesh"] = _plain(plan.rough)
    if name in LIT:
        found["path length"] = _path_length(plan, name)
        effects = plan.effects.of(name)
        found["openings"] = _openings(plan, name)
        found["transport"] = [effects.transport, effects.caustics]
        if in_step(plan, name):
            found["in step with"] = compared_with(plan, name) or ""
        if found["pixels"] == "object" or samples["goals"]:
            samples["object"] = _object_pixels(plan, name)
    if name in LIT or (name == "first_hit_rough" and lights_rough(plan)):
        found |= _light(plan, name if name in LIT else "rough")
    return found


def field_inputs(target: ObjectPlan, field: FieldPlan) -> Inputs:
    """What a field of an object depends on."""
    return {"pass": "field", "object": _object(target), "field": _plain(field)}


def shows_field(plan: ExamplePlan, name: str) -> bool:
    """Whether what a pass finds hangs on a field that was made."""
    rough = "rough" in name or name == "pbr"
    return plan.rough.field.made if rough else name == "source" and plan.field.made


def key_of(inputs: Inputs, made_by: dict[str, str]) -> str:
    """Key of what a pass finds: its inputs, its name among them, and the versions that make it."""
    return digest({"inputs": inputs, "versions": made_by})


def _samples(plan: ExamplePlan, name: str, steps: int) -> dict[str, Any]:
    goals = [[goal.model_dump(mode="json") for goal in goals_at(plan, name, step)] for step in range(steps)]
    extents = {goal.layer: dict(plan.render.layers).get(goal.layer, "object") for goal in goals_at(plan, name, 0)}
    parts = plan.render.parts(name)
    return {"spp": parts if extents else parts[:steps], "batches": plan.render.batches,
            "goals": goals if extents else [], "extents": extents}


def _object_pixels(plan: ExamplePlan, name: str) -> dict[str, Any]:
    """What says which pixels are the object's: the samples of the light-free passes, where they are taken."""
    free = ("first_hit", "first_hit_rough") if name in ROUGH else ("first_hit",)
    return {"parts": plan.render.parts("first_hit"), "pixels": [plan.effects.of(one).extent for one in free]}


def _path_length(plan: ExamplePlan, name: str) -> list[int]:
    return [plan.effects.of(name).max_depth, plan.render.rr_depth]


def _openings(plan: ExamplePlan, name: str) -> list[Inputs]:
    """What samples of the dome go through in a pass."""
    return [_plain(portal) for portal in plan.effects.of(name).portals]


def _light(plan: ExamplePlan, name: str) -> dict[str, Any]:
    """The lights that a pass simulates, and what is taken out of their way."""
    source = name.startswith("source")
    light: IlluminationPlan = plan.source_light if source else plan.target_light
    lights = [_plain(light.lights[index]) for index in plan.effects.of(name).lights]
    found = {"lights": lights, "open": list(light.open)}
    return {"source light": found} if source else {"target light": found | {"number": plan.light}}


def _placed(placed: PlacedObject) -> dict[str, Any]:
    """What stands where; a file counts by its content, not by its path."""
    return {**_plain(placed), "object": _object(placed.object)}


def _object(plan: ObjectPlan) -> Inputs:
    path = frozenset({"source"} if plan.kind != "procedural" else ())
    return _plain(plan, path) | {"scene": _source(plan.scene)}


def _room(room: RoomPlan) -> dict[str, Any]:
    """What is around; of a scene file, which things are taken away, not what the others are called."""
    materials = [own.model_dump(mode="json", exclude={"image"}) for own in room.materials]
    return _plain(room) | {"materials": materials,
                           "scene": {"file": _source(room.scene.file), "hidden": list(room.scene.hidden)}}


def _source(source: SceneSource) -> dict[str, Any]:
    """A scene file counts by its content and by how it is read."""
    return _plain(source, frozenset({"source", "roots", "models", "textures"}))


def _plain(model: Model, without: frozenset[str] = frozenset()) -> dict[str, Any]:
    return model.model_dump(mode="json", exclude=set(UNSEEN | without))
