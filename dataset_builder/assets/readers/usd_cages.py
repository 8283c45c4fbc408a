"""Subdivision surfaces of USD: how far each is refined, and by which rules.

https://openusd.org/release/api/class_usd_geom_mesh.html
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.geometry.cages import Cage, Round, at_boundary, refinement

if TYPE_CHECKING:
    from pxr import Usd

MOST_ROUNDS = 2
MESH_TRIANGLES, STAGE_TRIANGLES = 100_000, 2_000_000
"""That refinement comes to, of one mesh and of all of a stage, instances counted each."""
SCHEMES = ("catmullClark", "loop", "bilinear")
TIMES = ("as their control cages", "after one round", "after two rounds")


@dataclass(frozen=True, kw_only=True, eq=False)
class RefinedCage:
    """A subdivision surface on its way from the cage."""

    rounds: tuple[Round, ...]
    parent: np.ndarray
    """(F',) polygon of the cage that each of its polygons is from."""
    kept: np.ndarray
    """(F,) bool: polygons of the cage that have a surface."""
    decided: tuple[str, ...]


def cage_size(prim: "Usd.Prim") -> int:
    """Corners of the control cage of a mesh; 0 for what is no subdivision surface."""
    from pxr import Usd

    scheme = prim.GetAttribute("subdivisionScheme").Get()
    return 0 if scheme == "none" else len(prim.GetAttribute("faceVertexIndices").Get(Usd.TimeCode.EarliestTime()) or ())


def rounds_of(sizes: Sequence[int]) -> list[int]:
    """Rounds of refinement for each of a stage's meshes, 0 to `MOST_ROUNDS`, by the corners of their cages, such that
    neither a mesh nor all together come to too many triangles.

    >>> rounds_of([24, 20_000, 60_000]), set(rounds_of([12_500] * 50)), set(rounds_of([12_500] * 200))
    ([2, 1, 0], {1}, {0})
    """
    cages = np.asarray(sizes, dtype=np.int64).reshape(-1)
    for most in range(MOST_ROUNDS, 0, -1):
        made = [2 * 4 ** (rounds - 1) * cages for rounds in range(1, most + 1)]
        chosen = np.sum([each <= MESH_TRIANGLES for each in made], axis=0)
        total = sum(int(each[chosen == number].sum()) for number, each in enumerate(made, 1))
        if total <= STAGE_TRIANGLES:
            return [int(each) for each in chosen]
    return [0] * len(cages)


def refined(path: Path, prim: "Usd.Prim", polygons: tuple[np.ndarray, np.ndarray, int], kept: np.ndarray, *,
            rounds: int, planar: bool) -> RefinedCage:
    """The surface over (C,) indices and (F,) counts of so many vertices; kept: (F,) bool, polygons that are no holes.
    Raises UserError for creases and corners at vertices that are not there."""
    counts = polygons[1]
    scheme = str(prim.GetAttribute("subdivisionScheme").Get() or "catmullClark")
    if scheme not in SCHEMES:
        refuse(path, f"expected subdivisionScheme to be none or one of {' '.join(SCHEMES)}, got {scheme}",
               at=str(prim.GetPath()))
    cage = _cage(path, prim, polygons)
    boundary = str(prim.GetAttribute("interpolateBoundary").Get() or "edgeAndCorner")
    if boundary not in ("none", "edgeOnly", "edgeAndCorner"):
        refuse(path, f"expected interpolateBoundary to be none, edgeOnly or edgeAndCorner, got {boundary}",
               at=str(prim.GetPath()))
    decided = []
    if boundary == "none":
        kept = kept & ~at_boundary(cage)
    if scheme == "loop" and (counts != 3).any():
        rounds = 0
        decided.append("subdivision surfaces (loop) of faces that are no triangles, taken as their control cages")
    elif scheme == "bilinear" and planar:
        rounds = 0
    else:
        decided.append(f"subdivision surfaces ({scheme}) taken {TIMES[rounds]}, values of face corners linear")
    if prim.GetAttribute("triangleSubdivisionRule").Get() == "smooth" and rounds and (counts == 3).any():
        decided.append("triangleSubdivisionRule smooth, taken as catmullClark")
    found = refinement(cage, scheme, rounds=rounds, boundary=boundary)  # type: ignore[arg-type]
    parent = np.arange(len(counts))
    for each in found:
        parent = parent[each.parent]
    return RefinedCage(rounds=found, parent=parent, kept=kept, decided=tuple(decided))


def _cage(path: Path, prim: "Usd.Prim", polygons: tuple[np.ndarray, np.ndarray, int]) -> Cage:
    from pxr import Usd

    indices, counts, vertices = polygons

    def numbers(name: str, kind: type) -> np.ndarray:
        return np.asarray(prim.GetAttribute(name).Get(Usd.TimeCode.EarliestTime()) or (), dtype=kind).reshape(-1)

    chain, lengths, sharpness = numbers("creaseIndices", np.int64), numbers("creaseLengths", np.int64), numbers(
        "creaseSharpnesses", np.float64)
    corners, pointed = numbers("cornerIndices", np.int64), numbers("cornerSharpnesses", np.float64)
    at = str(prim.GetPath())
    for name, values in (("creaseIndices", chain), ("cornerIndices", corners)):
        wrong = values[(values < 0) | (values >= vertices)]
        if len(wrong):
            refuse(path, f"expected {name} in [0, {vertices}), got {len(wrong)} others, first {wrong[0]}", at=at)
    if not np.isfinite(sharpness).all() or not np.isfinite(pointed).all():
        refuse(path, "expected finite sharpnesses, got NaN or Inf", at=at)
    if len(corners) != len(pointed):
        refuse(path, f"expected {len(corners)} cornerSharpnesses, one for each corner, got {len(pointed)}", at=at)
    if (lengths < 2).any() or lengths.sum() != len(chain):
        refuse(path, f"expected creaseLengths of 2 or more that sum to the {len(chain)} creaseIndices, got others",
               at=at)
    inner = np.ones(len(chain), bool)
    inner[np.cumsum(lengths) - 1] = False
    starts = np.flatnonzero(inner)
    if len(sharpness) == len(lengths):
        sharpness = np.repeat(sharpness, lengths - 1)
    if len(sharpness) != len(starts):
        refuse(path, f"expected creaseSharpnesses for {len(lengths)} creases or their {len(starts)} edges, got "
                     f"{len(sharpness)}", at=at)
    sharp = np.zeros(vertices)
    np.maximum.at(sharp, corners, pointed)
    return Cage(vertices=vertices, indices=indices, counts=counts, corner_sharpness=sharp,
                creases=np.stack([chain[starts], chain[starts + 1]], axis=1) if len(starts) else np.zeros((0, 2), int),
                crease_sharpness=np.maximum(sharpness, 0))
