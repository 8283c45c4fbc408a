"""What is odd about the size of a planned object or of a scene, and where a spec mends it."""

from collections import Counter
from pathlib import Path

from dataset_builder.errors import Problem
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.contents import ScenePlan, place_of
from dataset_builder.planning.scene.scene_models import SceneFacts
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.usual_sizes import UNITS, SizeAdvice, length, size_advice, usual_of

LEAST_ODD = 2
"""Things of sizes that cannot be meant, from which a scene is in another unit than it is read in."""


def advice_on(plan: ObjectPlan, mesh_root: Path) -> SizeAdvice | None:
    """What is to be said about the size of a mesh file's object; None for embedded furniture, and where nothing is odd.

    Raises UserError where the file cannot be read.
    """
    if plan.kind != "file":
        return None
    return size_advice(asset_of(plan, mesh_root).mesh.size, category=plan.category, suffix=Path(plan.source).suffix,
                       scale=plan.scale, up=plan.up)


def size_problem(plan: ObjectPlan, loaded: LoadedSpec) -> tuple[Problem, bool] | None:
    """The same as a problem of the spec's line that names the mesh file, and whether it cannot be meant."""
    advice = advice_on(plan, loaded.path.parent)
    if advice is None:
        return None
    return Problem(where=place_of(loaded, plan), path="up" if advice.up else "scale", hint=advice.hint,
                   rule=f"{plan.source}: {advice.rule}"), advice.refused


def scene_size_problem(facts: SceneFacts, scene: ScenePlan, loaded: LoadedSpec) -> Problem | None:
    """A problem of the spec's line where most things of known kinds in a scene have sizes that cannot be meant; names
    may mislead about one or another."""
    if scene.file is None:
        return None
    known = [thing for thing in facts.things if thing.role == "object" and thing.size and usual_of(thing.category)]
    odd = [(thing, advice) for thing in known if (advice := size_advice(
        (thing.size,) * 3, category=thing.category, suffix="", scale=scene.file.scale, up="")) and advice.refused]
    if len(odd) < max(LEAST_ODD, len(known) // 2 + 1):
        return None
    (proposed, _), = Counter(advice.scale for _, advice in odd).most_common(1)
    first, unit = odd[0][0], UNITS.get(proposed or 0, "")
    hint = f"write `scale: {proposed:g}`" + f"; the file is probably in {unit}" * bool(unit and unit != "metres")
    return loaded.problem(scene.key, ("file", "scale"), f"expected things of usual sizes, got {first.name}, of kind "
                          f"{first.category}, of {length(first.size)}, and {len(odd) - 1} of {len(known) - 1} others "
                          "as odd", hint)
