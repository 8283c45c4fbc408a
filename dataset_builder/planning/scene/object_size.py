"""What is odd about the size of a planned object, and where a spec mends it."""

from pathlib import Path

from dataset_builder.errors import Problem
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.contents import place_of
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.usual_sizes import SizeAdvice, size_advice


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
