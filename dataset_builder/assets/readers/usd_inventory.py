"""What a USD stage says of itself, and what of it is not taken."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import refuse

if TYPE_CHECKING:
    from pxr import Usd

Y_UP_FROM = {"X": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), "Y": np.eye(3),
             "Z": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])}
"""Rotations by upAxis."""
DRAWN = ("default", "render")
"""Purposes that are taken."""


def stage_settings(path: Path, stage: "Usd.Stage") -> tuple[np.ndarray, list[str]]:
    """(4, 4) from the stage to metres with y up, and what was chosen where it leaves a choice."""
    from pxr import Usd, UsdGeom

    decided = []
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    if not 0 < unit < np.inf:
        refuse(path, f"expected metersPerUnit > 0, got {unit:g}")
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        decided.append("no metersPerUnit, taken as 0.01")
    axis = str(stage.GetMetadata("upAxis")) if stage.HasAuthoredMetadata("upAxis") else "Y"
    if axis not in Y_UP_FROM:
        refuse(path, f"expected upAxis to be X, Y or Z, got {axis!r}")
    for layer in stage.GetUsedLayers():
        own = layer.pseudoRoot.GetInfo("metersPerUnit") if layer.pseudoRoot.HasInfo("metersPerUnit") else unit
        if own != unit:
            decided.append(f"{Path(layer.realPath).name} has metersPerUnit {own:g}, taken as the stage's {unit:g}")
    sets = [f"{prim.GetPath()} {name}={prim.GetVariantSet(name).GetVariantSelection() or 'none'}"
            for prim in Usd.PrimRange(stage.GetPseudoRoot()) for name in prim.GetVariantSets().GetNames()]
    decided += [f"variants as selected: {', '.join(sets)}"] if sets else []
    matrix = np.eye(4)
    matrix[:3, :3] = unit * Y_UP_FROM[axis]
    return matrix, decided


def inventory(prim: "Usd.Prim") -> tuple[bool, list[str], list[str]]:
    """Whether a prim and what is under it are drawn, what of it is left out, and what was chosen where it may be."""
    from pxr import Usd, UsdGeom, UsdLux, UsdSkel

    first, lost, decided = Usd.TimeCode.EarliestTime(), list[str](), list[str]()
    kind = prim.GetTypeName()
    if prim.IsA(UsdGeom.Imageable):
        shown = UsdGeom.Imageable(prim)
        if shown.GetVisibilityAttr().Get(first) == "invisible":
            return False, [f"invisible {kind or 'prim'} {prim.GetPath()}"], []
        purpose = shown.ComputePurpose()
        if purpose not in DRAWN:
            return False, [f"{kind or 'prim'} {prim.GetPath()} of purpose {purpose}"], []
    if prim.IsA(UsdGeom.PointInstancer):
        return False, ["PointInstancer"], []
    if prim.HasAPI(UsdLux.LightAPI):
        lost.append(f"light of {kind}")
    elif not prim.IsA(UsdGeom.Mesh) and any(map(prim.IsA, (UsdGeom.Gprim, UsdGeom.Camera, UsdSkel.Skeleton,
                                                           UsdSkel.BlendShape))):
        lost.append(str(kind))
    if prim.IsA(UsdGeom.Mesh) and prim.HasAPI(UsdSkel.BindingAPI):
        decided.append("skinned meshes in the pose of their points")
    if any(attribute.ValueMightBeTimeVarying() for attribute in prim.GetAttributes()) or prim.HasMetadata("clips"):
        decided.append("animation at its first time")
    return True, lost, decided
