"""USD: every mesh and implicit shape of a stage, in metres and with y up, through OpenUSD.

https://openusd.org/release/api/class_usd_geom_mesh.html
"""

from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.assets.file_model import FileModel, counted, refuse
from dataset_builder.assets.readers.usd_cages import cage_size, rounds_of
from dataset_builder.assets.readers.usd_inventory import SHAPES, is_light
from dataset_builder.assets.readers.usd_meshes import has_faces
from dataset_builder.assets.readers.usd_parts import UsdParts
from dataset_builder.assets.readers.usd_stage import OpenStage, stage_of
from dataset_builder.assets.readers.usd_walk import UsdNode, UsdWalk
from dataset_builder.spec.mesh_source import splat_hint

if TYPE_CHECKING:
    from pxr import Usd


def read(path: Path, max_texture: int) -> FileModel:
    """All meshes and shapes of a stage. Raises UserError where the file cannot be read, for meshes that are no surface,
    and without usd-core."""
    with stage_of(path) as opened:
        return _read(opened, max_texture)


def _read(opened: OpenStage, max_texture: int) -> FileModel:
    from pxr import UsdGeom

    walk = UsdWalk(path=opened.path, stage=opened.stage)
    taken = UsdParts(opened=opened, max_texture=max_texture, left_out=walk.left_out, decided=walk.decided)
    found = []
    for node in walk.nodes():
        if is_light(node.prim):
            walk.left_out[f"light of {node.prim.GetTypeName()}"] += 1
        elif node.prim.IsA(UsdGeom.Camera):
            walk.left_out["Camera"] += 1
        elif is_drawn(walk, node):
            found.append(node)
    parts = []
    for node, rounds in zip(found, rounds_of([size_of(node.prim) for node in found]), strict=True):
        parts += taken.parts(node.prim, node.name, opened.metres @ node.matrix, rounds=rounds)
    lost = lost_words(walk)
    if not found:
        refuse(opened.path, f"expected mesh prims, got {', '.join(lost) or 'none'}", splat_hint(lost))
    roots = {node.name.split("/")[1] for node in found}
    several = (f"meshes of {len(roots)} root prims, whatever defaultPrim says",) if len(roots) > 1 else ()
    return FileModel(
        parts=tuple(parts), materials=tuple(each.file for each in taken.materials),
        contains=", ".join((counted(len(found), "mesh prim"), counted(taken.triangles, "triangle"),
                            counted(len(taken.materials), "material"))),
        left_out=(*lost, *opened.decided, *several, *taken.decided))


def is_drawn(walk: UsdWalk, node: UsdNode) -> bool:
    """Whether a prim becomes triangles; a mesh without faces is named."""
    from pxr import UsdGeom

    if not (node.prim.IsA(UsdGeom.Mesh) or node.prim.GetTypeName() in SHAPES):
        return False
    if has_faces(node.prim):
        return True
    walk.left_out[f"mesh {node.name}, which has no faces"] += 1
    return False


def size_of(prim: "Usd.Prim") -> int:
    """Corners of the control cage of a prim that is drawn; 0 for what is no subdivision surface."""
    return 0 if prim.GetTypeName() in SHAPES else cage_size(prim)


def lost_words(walk: UsdWalk) -> tuple[str, ...]:
    """What is left out, with how often, in words."""
    return tuple(f"{many} {what}" if many > 1 else what for what, many in walk.left_out.items())
