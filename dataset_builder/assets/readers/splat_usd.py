"""Splats of a USD stage: prims ParticleField3DGaussianSplat (OpenUSD 26.03 and later), in metres and with y up.

https://openusd.org/release/api/class_usd_vol_particle_field3_d_gaussian_splat.html: scales are linear, opacities in
[0, 1], and of each splat come all harmonics, degree 0 first.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers.splat_columns import SplatFile, check_count, check_harmonics, checked_cloud
from dataset_builder.assets.readers.splat_gltf import placed_cloud
from dataset_builder.assets.readers.usd import lost_words
from dataset_builder.assets.readers.usd_stage import OpenStage, naming, stage_of
from dataset_builder.assets.readers.usd_walk import UsdNode, UsdWalk
from dataset_builder.geometry.splat_moves import joined

if TYPE_CHECKING:
    from pxr import Usd

FIELD = "ParticleField3DGaussianSplat"
ENCODINGS = {"srgb_rec709_scene": True, "srgb_rec709_display": True, "lin_rec709_scene": False,
             "lin_rec709_display": False}
"""Whether a colour space is sRGB-encoded."""


def read(path: Path) -> SplatFile:
    """All splats of the stage. Colours are in the colour space that it states, and sRGB where it states none, as those
    who convert what trainers write leave them. Raises UserError where the file cannot be read, has no splats or too
    many, and without usd-core."""
    with stage_of(path) as opened:
        return _read(opened)


def _read(opened: OpenStage) -> SplatFile:
    walk = UsdWalk(path=opened.path, stage=opened.stage)
    nodes = [node for node in walk.nodes() if str(node.prim.GetTypeName()) == FIELD]
    walk.left_out.pop(FIELD, None)
    check_count(opened.path, sum(_count(opened.path, node) for node in nodes))
    files = []
    for node in nodes:
        with naming(opened.path, node.name):
            files.append(_splats(opened.path, node))
    if len({each.cloud.srgb for each in files}) > 1:
        refuse(opened.path, "expected splats of one colour space, got two", "take one prim of the stage")
    clouds = [placed_cloud(opened.path, node.name, each.cloud, opened.metres @ node.matrix)
              for node, each in zip(nodes, files, strict=True)]
    notes = [f"{node.name}: {note}" for node, each in zip(nodes, files, strict=True) for note in each.notes]
    return SplatFile(cloud=joined(clouds), notes=(*notes, *lost_words(walk), *opened.decided, *walk.decided))


def _count(path: Path, node: UsdNode) -> int:
    with naming(path, node.name):
        return len(_values(node.prim, "positions", 3, None))


def _splats(path: Path, node: UsdNode) -> SplatFile:
    from pxr import Usd

    prim = node.prim
    centres = _values(prim, "positions", 3, None)
    count = len(centres)
    degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get(Usd.TimeCode.EarliestTime())
    functions = (degree + 1)**2 if isinstance(degree, int) and 0 <= degree <= 3 else -1
    check_harmonics(path, functions, f"{node.name}.radiance:sphericalHarmonicsDegree")
    coefficients = _values(prim, "radiance:sphericalHarmonicsCoefficients", 3, None)
    notes = []
    if len(coefficients) != count * functions:
        refuse(path, f"expected {functions} coefficients for each of {count:,} splats, as degree {degree} has, got "
                     f"{len(coefficients):,}", at=f"{node.name}.radiance:sphericalHarmonicsCoefficients")
    space = str(Usd.ColorSpaceAPI.ComputeColorSpaceName(
        prim.GetAttribute("radiance:sphericalHarmonicsCoefficients"), None))
    if space and space not in ENCODINGS:
        refuse(path, f"expected one of {', '.join(ENCODINGS)}, got {space}", at=f"{node.name}.colorSpace:name")
    if not space:
        notes.append("no colour space is stated: colours taken as sRGB")
    with np.errstate(all="ignore"):
        return checked_cloud(
            path, centres=centres, scales=_values(prim, "scales", 3, count),
            turns=np.roll(_values(prim, "orientations", 4, count), 1, axis=1),
            opacities=_values(prim, "opacities", 1, count)[:, 0],
            harmonics=coefficients.reshape(count, functions, 3), srgb=ENCODINGS.get(space, True), notes=tuple(notes))


def _values(prim: "Usd.Prim", name: str, width: int, count: int | None) -> np.ndarray:
    """(N, width) float32 of an attribute, or of the one of half precision where that is empty. Raises ValueError where
    there are not `count`."""
    from pxr import Usd

    for each in (name, f"{name}h"):
        value = prim.GetAttribute(each).Get(Usd.TimeCode.EarliestTime())
        if value is not None and len(value):
            found = np.array(value, dtype=np.float32).reshape(len(value), width)
            break
    else:
        found = np.zeros((0, width), np.float32)
    if count is not None and len(found) != count:
        raise ValueError(f"{name}: expected {count:,} elements, as positions has, got {len(found):,}")
    return found
