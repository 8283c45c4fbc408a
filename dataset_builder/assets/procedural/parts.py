"""Parts of furniture: closed solids with the name of a finish, placed by their bounds, and put together as an asset."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.procedural.boxes import bevelled_box
from dataset_builder.assets.procedural.round_solids import COARSE, bar
from dataset_builder.assets.procedural.soft import ARC_STEPS, cushion
from dataset_builder.geometry.mesh import TriangleMesh, concatenate, transform

GAP = 0.0003
"""Metres between parts that touch, so that no two solids share volume."""

Span = tuple[float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Finish:
    """A material and the scale of its texture."""

    material: Material
    repeat: float = 1.0
    """Metres that one repeat of the texture covers."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """One closed solid, its coordinates in metres."""

    mesh: TriangleMesh
    finish: str
    patch: tuple[float, float] | None = None
    """Spot of the texture that pins its coordinates and stops repetition."""


Made = tuple[list[Part], dict[str, Finish]]
"""A piece of furniture before it is put together: its parts, and the finishes that they name."""


def block(x: Span, y: Span, z: Span, *, finish: str, bevel: float, grain: int | None = None) -> Part:
    """Chamfered box that fills the given spans."""
    low, high = np.array([x, y, z]).T
    width, depth, height = (high - low).tolist()
    mesh = bevelled_box((width, depth, height), bevel=bevel, grain=grain)
    return moved(Part(mesh=mesh, finish=finish), (low + high) / 2)


def padding(x: Span, y: Span, z: Span, *, finish: str, radius: float, crown: float = 0.0, side: str = "+z",
            inner_steps: int = 2, arc_steps: int = ARC_STEPS) -> Part:
    """Cushion that fills the given spans and swells towards `side` (+z up, -y to the front)."""
    low, high = np.array([x, y, z]).T
    size = high - low
    turn = np.eye(3) if side == "+z" else np.array([(1.0, 0, 0), (0, 0, -1), (0, 1, 0)])
    width, depth, height = np.abs(turn.T @ size).tolist()
    mesh = cushion((width, depth, height), radius=radius, crown=crown, inner_steps=inner_steps, arc_steps=arc_steps)
    return moved(Part(mesh=transform(mesh, _affine(turn)), finish=finish), (low + high) / 2)


def rod(start: Sequence[float] | np.ndarray, end: Sequence[float] | np.ndarray, radius: float, *, finish: str,
        sides: int = COARSE) -> Part:
    """Round bar between two points."""
    return Part(mesh=bar(np.asarray(start, dtype=float), np.asarray(end, dtype=float), radius, sides=sides),
                finish=finish)


def _affine(linear: np.ndarray, offset: Sequence[float] | np.ndarray = (0, 0, 0)) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, offset
    return matrix


def moved(part: Part, offset: Sequence[float] | np.ndarray) -> Part:
    """The part moved by `offset` (3,)."""
    return replace(part, mesh=transform(part.mesh, _affine(np.eye(3), offset)))


def turned_about_z(part: Part, degrees: float) -> Part:
    """The part turned counter-clockwise about the z axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return replace(part, mesh=transform(part.mesh, _affine(np.array([(c, -s, 0), (s, c, 0), (0, 0, 1.0)]))))


def facing_front(part: Part) -> Part:
    """The part turned so that what pointed up (+Z) points to the front (-Y)."""
    return replace(part, mesh=transform(part.mesh, _affine(np.array([(1.0, 0, 0), (0, 0, -1), (0, 1, 0)]))))


def mirrored(parts: Sequence[Part]) -> list[Part]:
    """The parts, and their mirror images across x = 0."""
    flip = _affine(np.diag([-1.0, 1, 1]))
    return [*parts, *(replace(part, mesh=transform(part.mesh, flip)) for part in parts)]


def bent(part: Part, bend: Callable[[np.ndarray], np.ndarray]) -> Part:
    """The part with its positions (V, 3) mapped; an injective map keeps parts apart that were apart."""
    return replace(part, mesh=replace(part.mesh, positions=bend(part.mesh.positions)))


def leaning(parts: Sequence[Part], *, above: float, degrees: float) -> list[Part]:
    """The parts sheared backwards (+Y) by `degrees` above height `above`; level edges stay level."""
    slope = np.tan(np.radians(degrees))

    def shear(points: np.ndarray) -> np.ndarray:
        back = slope * np.clip(points[:, 2] - above, 0, None)
        return points + np.stack([np.zeros_like(back), back, np.zeros_like(back)], axis=-1)

    return [bent(part, shear) for part in parts]


def assemble(parts: Sequence[Part], finishes: dict[str, Finish], *, name: str, category: str,
             rng: np.random.Generator) -> Asset:
    """Asset of the parts: on the floor, centred in x and y, texture shifted at random on every part.

    Materials stand in the order of `finishes`, are called by their key there and what they are (`top: oak`), and are
    left out where no part uses them.
    """
    asset = assemble_in_place(parts, finishes, name=name, category=category, rng=rng)
    low, high = asset.mesh.bounds
    offset = np.array([-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]])
    return replace(asset, mesh=transform(asset.mesh, _affine(np.eye(3), offset)))


def assemble_in_place(parts: Sequence[Part], finishes: dict[str, Finish], *, name: str, category: str,
                      rng: np.random.Generator) -> Asset:
    """As `assemble`, with every part left where it is."""
    used = [finish for finish in finishes if any(part.finish == finish for part in parts)]
    meshes = [_textured(part, finishes[part.finish], rng.uniform(size=2)) for part in parts]
    mesh = concatenate(meshes, material_offsets=[used.index(part.finish) for part in parts])
    materials = tuple(replace(finishes[finish].material, name=f"{finish}: {finishes[finish].material.name}")
                      for finish in used)
    meta = {"licence": "CC0-1.0", "source": "procedural"}
    return Asset(name=name, category=category, mesh=mesh, materials=materials, meta=meta)


def _textured(part: Part, finish: Finish, shift: np.ndarray) -> TriangleMesh:
    """The part's mesh with coordinates in repeats of its finish's texture."""
    origin = shift if part.patch is None else np.asarray(part.patch)
    return replace(part.mesh, uvs=part.mesh.uvs / finish.repeat + origin)
