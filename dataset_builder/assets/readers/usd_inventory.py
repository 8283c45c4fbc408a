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
    authored = stage.HasAuthoredMetadata("upAxis")
    axis = str(stage.GetMetadata("upAxis")) if authored else "Y"
    if axis not in Y_UP_FROM:
        refuse(path, f"expected upAxis to be X, Y or Z, got {axis!r}")
    for layer in stage.GetUsedLayers():
        own = layer.pseudoRoot.GetInfo("metersPerUnit") if layer.pseudoRoot.HasInfo("metersPerUnit") else unit
        if own != unit:
            decided.append(f"{Path(layer.realPath).name} has metersPerUnit {own:g}, taken as the stage's {unit:g}")
        turned = str(layer.pseudoRoot.GetInfo("upAxis")) if layer.pseudoRoot.HasInfo("upAxis") else axis
        if turned != axis:
            decided.append(f"{Path(layer.realPath).name} has upAxis {turned}, taken as the stage's {axis}")
    sets = [f"{prim.GetPath()} {name}={prim.GetVariantSet(name).GetVariantSelection() or 'none'}"
            for prim in Usd.PrimRange(stage.GetPseudoRoot()) for name in prim.GetVariantSets().GetNames()]
    decided += [f"variants as selected: {', '.join(sets)}"] if sets else []
    matrix = np.eye(4)
    matrix[:3, :3] = unit * Y_UP_FROM[axis]
    return matrix, decided


def inventory(prim: "Usd.Prim") -> tuple[list[str], list[str]]:
    """What of a prim by itself is left out, and what was chosen where it leaves a choice."""
    from pxr import UsdGeom, UsdSkel

    lost, decided = list[str](), list[str]()
    if is_unread(prim):
        lost.append(str(prim.GetTypeName()))
    if prim.IsA(UsdGeom.Mesh) and prim.HasAPI(UsdSkel.BindingAPI):
        decided.append("skinned meshes in the pose of their points")
    if prim.IsA(UsdGeom.Gprim) and prim.GetAttribute("doubleSided").HasAuthoredValue() \
            and not prim.GetAttribute("doubleSided").Get():
        decided.append("surfaces of one side are seen from both")
    if any(attribute.ValueMightBeTimeVarying() for attribute in prim.GetAttributes()) or prim.HasMetadata("clips"):
        decided.append("animation at its first time")
    if (drawn := prim.GetAttribute("model:drawMode").Get()) not in (None, "default", "inherited"):
        decided.append(f"drawMode {drawn} of {prim.GetPath()}, whose meshes are taken instead")
    return lost, decided


def is_light(prim: "Usd.Prim") -> bool:
    """Whether a prim is a light and nothing that is drawn."""
    from pxr import UsdGeom, UsdLux

    return bool(prim.HasAPI(UsdLux.LightAPI)) and not prim.IsA(UsdGeom.Gprim)


def is_unread(prim: "Usd.Prim") -> bool:
    """Whether a prim is drawn by others, or part of what is, and not by us: points, curves, volumes, skeletons."""
    from pxr import UsdGeom, UsdSkel

    read = prim.IsA(UsdGeom.Mesh) or str(prim.GetTypeName()) in SHAPES
    if prim.IsA(UsdSkel.Skeleton) or prim.IsA(UsdSkel.BlendShape):
        return True
    return bool(prim.IsA(UsdGeom.Gprim)) and not read


SHAPES = ("Cube", "Sphere", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")
"""Kinds of prims that are read as meshes."""
