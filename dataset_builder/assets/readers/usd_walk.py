"""Every prim of a USD stage that is there to be seen, with where it is: instances each, whatever makes them."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers.usd_instancers import MOST_INSTANCES, instances_of
from dataset_builder.assets.readers.usd_inventory import DRAWN, inventory
from dataset_builder.assets.readers.usd_stage import naming

if TYPE_CHECKING:
    from pxr import Usd

MOST_PRIMS = 200_000
MOST_NESTED = 500


@dataclass(frozen=True, kw_only=True, eq=False)
class UsdNode:
    """A prim at one of the places where it stands."""

    prim: "Usd.Prim"
    name: str
    """Its path, or for what a PointInstancer places `/Grass[7]/Blade`."""
    matrix: np.ndarray
    """(4, 4) stage_from_prim, for columns."""
    local: np.ndarray | None
    """(4, 4) parent_from_prim; None where the prim resets what is above it."""
    parent: "UsdNode | None"
    depth: int
    purpose: str
    """`default` unless it or one above says otherwise."""
    placed: bool = False
    """Whether it is an instance of a PointInstancer."""

    def relative_to(self, root: "UsdNode") -> np.ndarray:
        """(4, 4) root_from_prim, from the transforms between them, so that it is the same for every instance."""
        matrix = np.eye(4)
        for node in self.above():
            if node is root:
                return matrix
            if node.local is None:
                return np.linalg.solve(root.matrix, node.matrix) @ matrix
            matrix = node.local @ matrix
        return np.linalg.solve(root.matrix, self.matrix)

    def above(self) -> "Iterator[UsdNode]":
        """It and those above it, the stage's own root left out."""
        node: UsdNode | None = self
        while node is not None and node.parent is not None:
            yield node
            node = node.parent


@dataclass(kw_only=True, eq=False)
class UsdWalk:
    """A way through a stage, and what it found there."""

    path: Path
    stage: "Usd.Stage"
    left_out: Counter[str] = field(default_factory=Counter)
    decided: dict[str, None] = field(default_factory=dict)
    """What was chosen where the stage leaves a choice, in words, each once."""
    instances: int = 0

    def nodes(self) -> Iterator[UsdNode]:
        """All prims that are visible, of purpose default or render, in the order of the stage; what instances share
        comes once for each. Raises UserError for too many, and for instances of themselves."""
        from pxr import Usd, UsdGeom

        every = Usd.PrimRange.Stage(self.stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
        if prim := next(islice(every, MOST_PRIMS, None), None):  # Before the first is looked at, which takes far longer
            self._refuse_more(str(prim.GetPath()))
        waiting = [UsdNode(prim=self.stage.GetPseudoRoot(), name="", matrix=np.eye(4), local=np.eye(4), parent=None,
                           depth=0, purpose="default")]
        number = 1
        while waiting:
            node = waiting.pop()
            if node.depth > MOST_NESTED:
                refuse(self.path, f"expected prims at most {MOST_NESTED} deep, got more", at=node.name)
            with naming(self.path, node.name):
                seen = self._is_seen(node)
            if not seen:
                continue
            drawn = node.purpose in DRAWN
            if node.parent is not None and drawn:
                yield node
            below: list[UsdNode] = []
            if not node.prim.IsA(UsdGeom.PointInstancer):
                below = [self._child(node, prim) for prim in self._children(node)]
            elif drawn:
                below = self._placed(node)
            number += len(below)
            if number > MOST_PRIMS:
                self._refuse_more(node.name)
            waiting += reversed(below)

    def _refuse_more(self, at: str) -> NoReturn:
        refuse(self.path, f"expected at most {MOST_PRIMS:,} prims, instances counted each, got more", at=at)

    def _is_seen(self, node: UsdNode) -> bool:
        """Whether a node is visible; names it where it is not, or where its purpose begins to be another's."""
        from pxr import Usd, UsdGeom

        prim, kind = node.prim, node.prim.GetTypeName() or "prim"
        if not prim.IsA(UsdGeom.Imageable):
            return True
        if UsdGeom.Imageable(prim).GetVisibilityAttr().Get(Usd.TimeCode.EarliestTime()) == "invisible":
            self.left_out[f"invisible {kind} {prim.GetPath()}"] += 1
            return False
        if node.purpose not in DRAWN:
            if node.parent is None or node.parent.purpose != node.purpose:
                self.left_out[f"{kind} {prim.GetPath()} of purpose {node.purpose}"] += 1
            return True
        lost, chosen = inventory(prim)
        self.left_out.update(lost)
        self.decided |= dict.fromkeys(chosen)
        return True

    def _children(self, node: UsdNode) -> list["Usd.Prim"]:
        from pxr import Usd

        which = Usd.PrimDefaultPredicate
        if any(each.placed for each in node.above()):
            which = Usd.PrimIsActive & Usd.PrimIsLoaded  # Prototypes may be below classes and overs
        return list(node.prim.GetFilteredChildren(Usd.TraverseInstanceProxies(which)))

    def _child(self, node: UsdNode, prim: "Usd.Prim") -> UsdNode:
        name = f"{node.name}/{prim.GetName()}"
        with naming(self.path, name):
            matrix, local = self._matrices(node, prim)
        return UsdNode(prim=prim, name=name, matrix=matrix, local=local, parent=node,
                       depth=node.depth + 1, purpose=_purpose(prim, node.purpose))

    def _matrices(self, node: UsdNode, prim: "Usd.Prim") -> tuple[np.ndarray, np.ndarray | None]:
        """stage_from_prim and parent_from_prim of a child of a node."""
        from pxr import Usd, UsdGeom

        if not prim.IsA(UsdGeom.Xformable):
            return node.matrix, np.eye(4)
        moved = UsdGeom.Xformable(prim)
        for name in moved.GetXformOpOrderAttr().Get() or ():
            if name != "!resetXformStack!" and not prim.HasAttribute(name.removeprefix("!invert!")):
                refuse(self.path, f"expected xformOps that the prim has, got {name}", at=str(prim.GetPath()))
        local = np.array(moved.GetLocalTransformation(Usd.TimeCode.EarliestTime())).T
        base, resets = node.matrix, moved.GetResetXformStack()
        if resets:
            base = next((each.matrix for each in node.above() if each.placed), np.eye(4))
        with np.errstate(all="ignore"):
            matrix = base @ local
        if not np.isfinite(matrix).all() or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-9:
            refuse(self.path, "expected an affine transform of finite numbers, got another", at=str(prim.GetPath()))
        return matrix, None if resets else local

    def _placed(self, node: UsdNode) -> list[UsdNode]:
        """What a PointInstancer places."""
        from pxr import UsdGeom

        if sum(each.prim == node.prim for each in node.above()) > 1:
            refuse(self.path, "expected prototypes that are not instances of themselves, got one that is",
                   at=str(node.prim.GetPath()))
        with naming(self.path, node.name):
            found, hidden = instances_of(self.path, node.prim)
        self.instances += len(found)
        if self.instances > MOST_INSTANCES:
            refuse(self.path, f"expected at most {MOST_INSTANCES:,} instances of PointInstancers in all, got "
                              f"{self.instances:,} or more", "deactivate the prim, or make some of them inactive",
                   at=str(node.prim.GetPath()))
        each = [str(primvar.GetPrimvarName()) for primvar in UsdGeom.PrimvarsAPI(node.prim).GetPrimvarsWithValues()
                if primvar.GetInterpolation() != "constant"]
        if each:
            self.left_out[f"{', '.join(each)} of each instance of {node.prim.GetPath()}"] += 1
        if hidden:
            self.left_out[f"{hidden} invisible or inactive instances of {node.prim.GetPath()}"] += 1
        return [UsdNode(prim=prim, name=f"{node.name}[{number}]", matrix=node.matrix @ matrix, local=matrix,
                        parent=node, depth=node.depth + 1, purpose=_purpose(prim, node.purpose), placed=True)
                for number, prim, matrix in found]


def _purpose(prim: "Usd.Prim", above: str) -> str:
    """The purpose that a prim says, or else that of what is above it."""
    from pxr import UsdGeom

    if not prim.IsA(UsdGeom.Imageable):
        return above
    said = UsdGeom.Imageable(prim).GetPurposeAttr()
    return str(said.Get()) if said and said.HasAuthoredValue() else above
