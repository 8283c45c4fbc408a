"""Prims of a USD stage that are drawn -> which of them are one thing.

A thing is, for each mesh or shape, what comes first of
1. the lowest prim at or above it that a pattern of the spec's `parts` names in full,
2. the outermost component of the model hierarchy (`kind`), or else the outermost subcomponent,
3. the outermost instance of a PointInstancer,
4. the lowest scene-graph instance, or else the lowest Xform above it; the only root prim that holds anything is none.
   Or the outermost Xform around that which is called after one kind of thing: a `Table` with its legs,
5. the mesh itself.
Things hold no other things: an instance or Xform (4) that would, and is not called so, is no thing, and its own meshes
are. What is below a component, instance or Xform (2, 4) by 4 and 5 are things in its place where their names mean
different parts of a building: see `roles.is_building`.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

from dataset_builder.assets.readers.usd_walk import UsdNode
from dataset_builder.assets.scene_readers.roles import is_building
from dataset_builder.assets.scene_readers.thing_tree import is_one_kind

if TYPE_CHECKING:
    from pxr import Usd

Group = tuple[UsdNode, list[UsdNode]]
"""The root of a thing, and the meshes and shapes that it is made of."""


def things_of(drawn: Sequence[UsdNode], named: Collection[str]) -> list[Group]:
    """The things of a stage in its order; each of the drawn nodes is part of one. named: paths that the spec gives."""
    tops = {node.name.split("/")[1].split("[")[0] for node in drawn}
    found = _grouped(drawn, [_root_of(node, named, alone=len(tops) == 1) for node in drawn])
    return [thing for group in found for thing in _apart(group, named)]


def _grouped(drawn: Sequence[UsdNode], roots: Sequence[tuple[UsdNode, bool]]) -> list[Group]:
    """Nodes by their roots, of which those that are a guess may not hold others."""
    holders = {above.name for root, _ in roots for above in root.above() if above is not root}
    things: dict[str, Group] = {}
    for node, (root, loose) in zip(drawn, roots, strict=True):
        top = node if loose and root.name in holders else root
        things.setdefault(top.name, (top, []))[1].append(node)
    return list(things.values())


def _apart(group: Group, named: Collection[str]) -> list[Group]:
    """A thing, or where it is a building that the spec does not name, its parts and what else is below it."""
    top, meshes = group
    if top.name in named or top.placed or any(mesh is top for mesh in meshes):
        return [group]
    roots = [(next(_xforms(takewhile(lambda each: each is not top, mesh.above())), mesh), True) for mesh in meshes]
    pieces = [piece for below in _grouped(meshes, roots) for piece in _apart(below, named)]
    parts = is_building(top.prim.GetName(), (piece.prim.GetName() for piece, _ in pieces))
    return pieces if parts else [group]


def _root_of(node: UsdNode, named: Collection[str], *, alone: bool) -> tuple[UsdNode, bool]:
    """The prim that a drawn node belongs to, and whether that is only a guess."""
    chain = list(node.above())
    for each in chain:
        if each.name in named:
            return each, False
    for kind in ("component", "subcomponent"):
        if models := [each for each in chain if _is_kind(each.prim, kind)]:
            return models[-1], False
    if placed := [each for each in chain if each.placed]:
        return placed[-1], False
    groups = [each for each in _xforms(chain) if not (alone and each.depth == 1)]
    own = next((each for each in chain if each.prim.IsInstance()), groups[0] if groups else node)
    called = [each for each in groups if each.depth <= own.depth and is_one_kind(each.prim.GetName())]
    return (called[-1], False) if called else (own, own is not node)


def _xforms(chain: Iterable[UsdNode]) -> Iterator[UsdNode]:
    """Those of some nodes that are no shapes, and have a place."""
    from pxr import UsdGeom

    return (each for each in chain if each.prim.IsA(UsdGeom.Xformable) and not each.prim.IsA(UsdGeom.Gprim))


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
