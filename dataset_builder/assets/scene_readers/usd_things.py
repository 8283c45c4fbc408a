"""Prims of a USD stage that are drawn -> which of them are one thing.

A thing is, for each mesh or shape, what comes first of
1. the lowest prim at or above it that a pattern of the spec's `parts` names in full,
2. the outermost component of the model hierarchy (`kind`), or else the outermost subcomponent,
3. the outermost instance of a PointInstancer,
4. the lowest scene-graph instance,
5. the lowest Xform above it; the only root prim that holds anything is none,
6. the mesh itself.
Things hold no other things: an instance or Xform (4, 5) that would is no thing, and its own meshes are.
"""

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

from dataset_builder.assets.readers.usd_walk import UsdNode

if TYPE_CHECKING:
    from pxr import Usd

Group = tuple[UsdNode, list[UsdNode]]
"""The root of a thing, and the meshes and shapes that it is made of."""


def things_of(drawn: Sequence[UsdNode], named: Collection[str]) -> list[Group]:
    """The things of a stage in its order; each of the drawn nodes is part of one. named: paths that the spec gives."""
    tops = {node.name.split("/")[1].split("[")[0] for node in drawn}
    found = [_root_of(node, named, alone=len(tops) == 1) for node in drawn]
    holders = {above.name for root, _ in found for above in root.above() if above is not root}
    things: dict[str, Group] = {}
    for node, (root, loose) in zip(drawn, found, strict=True):
        top = node if loose and root.name in holders else root
        things.setdefault(top.name, (top, []))[1].append(node)
    return list(things.values())


def _root_of(node: UsdNode, named: Collection[str], *, alone: bool) -> tuple[UsdNode, bool]:
    """The prim that a drawn node belongs to, and whether that is only a guess."""
    from pxr import UsdGeom

    chain = list(node.above())
    for each in chain:
        if each.name in named:
            return each, False
    for kind in ("component", "subcomponent"):
        if models := [each for each in chain if _is_kind(each.prim, kind)]:
            return models[-1], False
    if placed := [each for each in chain if each.placed]:
        return placed[-1], False
    for each in chain:
        if each.prim.IsInstance():
            return each, True
    for each in chain[1:]:
        if each.prim.IsA(UsdGeom.Xformable) and not each.prim.IsA(UsdGeom.Gprim) and not (alone and each.depth == 1):
            return each, True
    return node, False


def _is_kind(prim: "Usd.Prim", kind: str) -> bool:
    from pxr import Kind, Usd

    said = Usd.ModelAPI(prim).GetKind()
    return bool(said) and (said == kind or bool(Kind.Registry.IsA(said, kind)))


def words_for(root: UsdNode, meshes: Iterable[UsdNode]) -> list[str]:
    """What may tell the category of a thing, the surest first: labels of it, its name, the name of its asset, and of
    its meshes."""
    from pxr import Usd

    labels = []
    for attribute in root.prim.GetAuthoredAttributes():
        name = str(attribute.GetName())
        if name.startswith("semantics:labels:"):
            labels += [str(label) for label in attribute.Get() or ()]
        elif name.startswith("semantic:") and name.endswith(":params:semanticData"):
            labels.append(str(attribute.Get() or ""))
    return [*labels, root.prim.GetName(), str(Usd.ModelAPI(root.prim).GetAssetName() or ""),
            *(mesh.prim.GetName() for mesh in meshes)]
