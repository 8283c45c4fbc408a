"""Lights as planning's own paths find them: a point drawn on one of them, or a lamp that a path meets."""

from collections.abc import Sequence
from math import pi

import numpy as np

from dataset_builder.geometry.light_axes import rectangle_axes
from dataset_builder.geometry.pinhole import sphere_lattice
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.walk_surfaces import LIFT, WalkSurfaces
from dataset_builder.planning.view.emission import LEAVING

SIDES = 16
"""Of what stands for a disk or a cylinder."""
FAR = 1e3
"""Metres that a sun is away."""
EVEN = 0.2
"""Share of the points drawn that goes to all lights alike, whatever they weigh."""


class WalkLamps:
    """The lights of one pass. Images on them count as their mean; lamps are made of triangles."""

    def __init__(self, lights: Sequence[LightPlan]):
        self.sky = sum((np.asarray(each.radiance) for each in lights if LIGHT_KINDS[each.kind].all_round), np.zeros(3))
        self._lights = [each for each in lights if not LIGHT_KINDS[each.kind].all_round]
        weights = np.array([each.weight for each in self._lights])
        count, total = max(len(weights), 1), weights.sum()
        self._chance = EVEN / count + (1 - EVEN) * (weights / total if total > 0 else np.full(len(weights), 1 / count))
        shapes = [_triangles(each) for each in self._lights]
        self._corners = np.concatenate([np.zeros((0, 3, 3)), *shapes])
        self._starts = np.cumsum([0, *(len(shape) for shape in shapes)])
        self._owner = np.repeat(np.arange(len(shapes)), np.diff(self._starts))
        edge = self._corners[:, 1:] - self._corners[:, :1]
        normals = np.cross(edge[:, 0], edge[:, 1])
        length = np.linalg.norm(normals, axis=1)
        self._area, self._normal = length / 2, normals / np.maximum(length, 1e-30)[:, None]
        self._radiance = np.array([each.radiance for each in self._lights]).reshape(-1, 3)
        self._rays = RayScene([(self._corners.reshape(-1, 3), np.arange(3 * len(self._corners)).reshape(-1, 3), 1)])

    def meet(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of rays from (N, 3) along unit (N, 3): (N,) metres to the first lamp, inf for none; (N, 3) radiance of it."""
        face, distance, _ = self._rays.met(origins, directions)
        if not len(self._corners):
            return distance, np.zeros((len(origins), 3))
        facing = np.einsum("ij,ij->i", self._normal[face], directions) < 0
        return distance, self._radiance[self._owner[face]] * ((face >= 0) & facing)[:, None]

    def arriving(self, points: np.ndarray, normals: np.ndarray | None, surfaces: WalkSurfaces,
                 draws: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Light of one point of one light that arrives at points (N, 3), an unbiased estimate but right beside lamps:
        (N, 3) irradiance by unit normals (N, 3), or without them from all sides; (N,) surfaces of solid glass on the
        way, (N, 3) the way itself."""
        sent, crossed = np.zeros((len(points), 3)), np.zeros(len(points), np.int64)
        if not self._lights or not len(points):
            return sent, crossed, sent
        chosen = draws.choice(len(self._lights), len(points), p=self._chance)
        numbers, ends = draws.random((len(points), 3)), np.empty_like(points)
        for index in np.unique(chosen).tolist():
            own = np.flatnonzero(chosen == index)
            ends[own], unit = self._points(index, points[own], numbers[own])
            sent[own] = unit[:, None] * self._radiance[index] / self._chance[index]
        towards = ends - points
        far = np.linalg.norm(towards, axis=1)
        if normals is not None:
            sent *= np.maximum(np.einsum("ij,ij->i", towards, normals) / np.maximum(far, 1e-9), 0)[:, None]
        lit = np.flatnonzero(sent.any(axis=1))
        short = LIFT / np.maximum(far[lit], LIFT)
        passed, crossed[lit] = surfaces.between(points[lit], ends[lit] - short[:, None] * towards[lit])
        sent[lit] *= passed[:, None]
        return sent, crossed, towards

    def _points(self, index: int, points: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) points of a light, and (N,) irradiance facing them per unit of its radiance, at points (N, 3)."""
        light = self._lights[index]
        if LIGHT_KINDS[light.kind].parallel:
            return points - FAR * np.asarray(light.direction), np.ones(len(points))
        first, last = self._starts[index:index + 2]
        if first == last:
            ends = np.broadcast_to(light.position, points.shape)
            away = points - ends
            far = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
            leaving = LEAVING[light.kind](away @ np.asarray(light.direction) / far, light)
            return ends, leaving / far**2
        areas = np.cumsum(self._area[first:last])
        face = first + np.minimum(np.searchsorted(areas / areas[-1], numbers[:, 0], side="right"), last - first - 1)
        root = np.sqrt(numbers[:, 1])
        share = np.stack([1 - root, root * (1 - numbers[:, 2]), root * numbers[:, 2]], axis=1)
        ends = np.einsum("nk,nkc->nc", share, self._corners[face])
        away = points - ends
        far = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        leaving = np.maximum(np.einsum("ij,ij->i", away, self._normal[face]) / far, 0)
        # No lamp sends more than pi times its radiance: right beside it one point would count as if all were there
        return ends, np.minimum(leaving * areas[-1] / far**2, pi)


def _triangles(light: LightPlan) -> np.ndarray:
    """(T, 3, 3) corners of a lamp, counter-clockwise from where it shines; none of one without an extent."""
    middle = np.asarray(light.position)
    turns = 2 * pi * np.arange(SIDES + 1) / SIDES
    if light.kind == "area":
        right, up = rectangle_axes(light.direction, light.turn)
        a, b = right * light.size / 2, up * (light.length or light.size) / 2
        return middle + np.array([[-a - b, a - b, a + b], [-a - b, a + b, b - a]])
    if light.kind == "disk":
        rim = middle + light.size * _circle(light.direction, turns)
        return np.stack([np.broadcast_to(middle, rim[1:].shape), rim[:-1], rim[1:]], axis=1)
    if light.kind == "cylinder":
        half = np.asarray(light.direction) * light.length / 2
        low, high = (middle + light.size * _circle(light.direction, turns) + end for end in (-half, half))
        return np.concatenate([np.stack([low[:-1], low[1:], high[1:]], axis=1),
                               np.stack([low[:-1], high[1:], high[:-1]], axis=1)])
    if light.kind == "sphere":
        return middle + light.size * _ball()
    return np.zeros((0, 3, 3))


def _circle(axis: Sequence[float], turns: np.ndarray) -> np.ndarray:
    """(N, 3) unit vectors square to an axis, counter-clockwise about it."""
    right, up = rectangle_axes(axis, 0.0)
    return np.cos(turns)[:, None] * right + np.sin(turns)[:, None] * up


def _ball() -> np.ndarray:
    """(T, 3, 3) corners of a polyhedron in the unit sphere, outward."""
    from scipy.spatial import ConvexHull

    points = sphere_lattice(8 * SIDES)
    corners = points[ConvexHull(points).simplices]
    outward = np.einsum("ij,ij->i", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                        corners.mean(axis=1)) > 0
    return np.where(outward[:, None, None], corners, corners[:, [0, 2, 1]])
