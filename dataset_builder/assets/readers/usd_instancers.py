"""PointInstancer: https://openusd.org/release/api/class_usd_geom_point_instancer.html"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset_builder.assets.file_model import refuse

if TYPE_CHECKING:
    from pxr import Usd

MOST_INSTANCES = 20_000
"""Of all PointInstancers of a stage: each becomes triangles of its own."""


def instances_of(path: Path, prim: "Usd.Prim") -> tuple[list[tuple[int, "Usd.Prim", np.ndarray]], int]:
    """Number, prototype and (4, 4) instancer_from_prototype of each instance that is visible and active, the transform
    of the prototype's root included, and how many are not. Raises UserError for arrays that do not belong together."""
    from pxr import Usd, UsdGeom

    first, at = Usd.TimeCode.EarliestTime(), str(prim.GetPath())
    instancer = UsdGeom.PointInstancer(prim)
    order = np.asarray(_value(instancer.GetProtoIndicesAttr(), first), dtype=np.int64).reshape(-1)
    if len(order) > MOST_INSTANCES:
        refuse(path, f"expected at most {MOST_INSTANCES:,} instances of PointInstancers in all, got {len(order):,}",
               "deactivate the prim, or make some of them inactive", at=at)
    for name, attribute in (("positions", instancer.GetPositionsAttr()), ("scales", instancer.GetScalesAttr()),
                            ("orientations", instancer.GetOrientationsAttr()), ("ids", instancer.GetIdsAttr())):
        values = _value(attribute, first)
        if len(values) != len(order) and (len(values) or name == "positions"):
            refuse(path, f"expected {len(order)} {name}, one for each of protoIndices, got {len(values)}", at=at)
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    prototypes = [prim.GetStage().GetPrimAtPath(target) for target in targets]
    for target, prototype in zip(targets, prototypes, strict=True):
        if not prototype:
            refuse(path, f"expected prototypes that are prims, got {target}", at=at)
    wrong = order[(order < 0) | (order >= len(prototypes))]
    if len(wrong):
        refuse(path, f"expected protoIndices in [0, {len(prototypes)}), got {len(wrong)} others, first {wrong[0]}",
               at=at)
    if not len(order):
        return [], 0
    matrices = instancer.ComputeInstanceTransformsAtTime(
        first, first, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask)
    found = np.array(matrices, dtype=np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    if len(found) != len(order) or not np.isfinite(found).all():
        refuse(path, f"expected {len(order)} instances at finite places, got others", at=at)
    mask = list(instancer.ComputeMaskAtTime(first)) or [True] * len(order)
    kept = [(int(number), prototypes[order[number]], found[number]) for number in np.flatnonzero(mask)]
    return kept, len(order) - len(kept)


def _value(attribute: "Usd.Attribute", time: "Usd.TimeCode") -> Any:
    found = attribute.Get(time) if attribute else None
    return found if found is not None else ()
