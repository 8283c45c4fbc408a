"""Implicit shapes of USD as polygons: https://openusd.org/release/api/usd_geom_page_front.html"""

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.file_model import refuse

if TYPE_CHECKING:
    from pxr import Usd

SIDES = 32
"""Of what is round; half as many from pole to pole."""
BOX = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]])
"""Faces over the vertices of a box in binary order of x, y, z."""
Polygons = tuple[np.ndarray, np.ndarray, np.ndarray]
"""(V, 3) points, (C,) indices into them, and (F,) corners of each polygon, counter-clockwise from outside."""


def shape_polygons(path: Path, prim: "Usd.Prim") -> Polygons:
    """The surface of a Cube, Sphere, Cylinder, Cone, Capsule or Plane. Raises UserError for sizes below 0."""
    kind = str(prim.GetTypeName())
    read = _Sizes(path, prim)
    if kind == "Cube":
        corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
        return corners * read("size", 2.0) / 2, BOX.reshape(-1), np.full(6, 4)
    axis = str(prim.GetAttribute("axis").Get() or "Z") if prim.HasAttribute("axis") else "Z"
    if axis not in ("X", "Y", "Z"):
        refuse(path, f"expected an axis X, Y or Z, got {axis}", at=str(prim.GetPath()))
    if kind == "Plane":
        return _plane(read("width", 2.0), read("length", 2.0), axis)
    points, indices, counts = _turned(_profile(kind, read))
    turn = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}[axis]
    return points[:, turn], indices, counts


def _profile(kind: str, read: "_Sizes") -> np.ndarray:
    """(N, 2) radius and height from the lowest point to the highest."""
    quarter = np.linspace(0, np.pi / 2, SIDES // 4 + 1)
    if kind == "Sphere":
        turns = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
        return read("radius", 1.0) * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    if kind.startswith("Capsule"):
        half = read("height", 1.0) / 2
        low, high = (read("radius", 0.5),) * 2 if kind == "Capsule" else (read("radiusBottom", 0.5),
                                                                          read("radiusTop", 0.5))
        return np.concatenate([
            np.stack([low * np.sin(quarter), -half - low * np.cos(quarter)], axis=1),
            np.stack([high * np.cos(quarter), half + high * np.sin(quarter)], axis=1)])
    half = read("height", 2.0) / 2
    if kind == "Cylinder_1":
        return np.array([[read("radiusBottom", 1.0), -half], [read("radiusTop", 1.0), half]])
    radius = read("radius", 1.0)
    return np.array([[radius, -half], [0.0 if kind == "Cone" else radius, half]])


def _turned(profile: np.ndarray) -> Polygons:
    """A profile turned about z, closed by flat ends."""
    turns = np.arange(SIDES) * 2 * np.pi / SIDES
    around = np.arange(SIDES)
    after = (around + 1) % SIDES
    rings = np.stack([profile[:, :1] * np.cos(turns), profile[:, :1] * np.sin(turns),
                      np.broadcast_to(profile[:, 1:], (len(profile), SIDES))], axis=2)
    faces: list[list[int]] = []
    small = profile[:, 0] <= 1e-9 * max(float(profile[:, 0].max()), 1e-300)
    number = np.where(small[:, None], np.arange(len(profile))[:, None] * SIDES,
                      np.arange(len(profile))[:, None] * SIDES + around)
    if not small[0]:
        faces.append(number[0][::-1].tolist())
    for low, high in pairwise(number):
        for one, two in zip(around, after, strict=True):
            ring = [int(low[one]), int(low[two]), int(high[two]), int(high[one])]
            corners = [*dict.fromkeys(ring)]
            faces += [corners] if len(corners) > 2 else []
    if not small[-1]:
        faces.append(number[-1].tolist())
    return (rings.reshape(-1, 3), np.array([corner for face in faces for corner in face], dtype=np.int64),
            np.array([len(face) for face in faces], dtype=np.int64))


def _plane(width: float, length: float, axis: str) -> Polygons:
    """A rectangle whose front is towards its axis; its width lies along x, or along z where x is the axis."""
    across, along = {"X": (2, 1), "Y": (0, 2), "Z": (0, 1)}[axis]
    points = np.zeros((4, 3))
    points[:, across] = np.array([-1, 1, 1, -1]) * width / 2
    points[:, along] = np.array([-1, -1, 1, 1]) * length / 2
    return points, np.arange(4) if axis == "Z" else np.arange(4)[::-1], np.array([4])


class _Sizes:
    """Numbers of a prim by name, at its first time."""

    def __init__(self, path: Path, prim: "Usd.Prim") -> None:
        self.path, self.prim = path, prim

    def __call__(self, name: str, default: float) -> float:
        from pxr import Usd

        value = self.prim.GetAttribute(name).Get(Usd.TimeCode.EarliestTime())
        number = float(default if value is None else value)
        if not 0 <= number < np.inf:
            refuse(self.path, f"expected a size of 0 or more, got {name} {number:g}", at=str(self.prim.GetPath()))
        return number
