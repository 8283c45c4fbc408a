"""Do depth, normals and the camera of the label describe one surface?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dataset_builder.release.cells import WHOLE, eroded
from dataset_builder.release.dataset_check import Check, Rule

SMOOTH = 0.9
"""Least length of a mean normal: below, the pixel sees several faces."""
MIN_PIXELS = 20
"""Of an example that has an angle or a reach of its own."""
FAR = 0.98
"""Quantile of pixels that an example's reach is taken at."""

REACH = Rule(name="depth", high=2.0, why="the camera aims into the object's bounding sphere, and the object fills it",
             statement="distance along the view axis from depth to the camera's aim in bounding radii, maximum over "
                       "examples")
NORMALS = Rule(name="normals", low=0.9, why="1 on flat faces; a little less with smooth shading and noise",
               statement="cosine between normal and the normal of the surface that depth spans, 5% quantile of "
                         "examples' medians")
RULES = (REACH, NORMALS)


@dataclass(frozen=True, kw_only=True)
class SurfaceFacts:
    """One example. reach: see `REACH`; cosine: median, see `NORMALS`; NaN where layers or label do not tell."""

    key: str
    reach: float
    cosine: float


def surface_of(key: str, layers: Mapping[str, np.ndarray], label: Mapping[str, Any]) -> SurfaceFacts:
    """What depth (H, W, 1), normal (H, W, 3), and the camera and bounding radius of the label say about each other."""
    if "depth" not in layers:
        return SurfaceFacts(key=key, reach=float("nan"), cosine=float("nan"))
    camera, radius = label["plan"]["camera"], label["record"].get("bounding_radius", 0.0)
    whole = layers["mask"][..., 0] >= WHOLE
    reach = cosine = float("nan")
    if radius > 0 and whole.sum() >= MIN_PIXELS:
        away = np.abs(layers["depth"][..., 0][whole] - np.linalg.norm(_vector(camera, "target", "position")))
        reach = float(np.quantile(away, FAR) / radius)
    if "normal" in layers:
        cosine = _median_cosine(layers["depth"][..., 0].astype(np.float64), layers["normal"], whole, camera)
    return SurfaceFacts(key=key, reach=reach, cosine=cosine)


def positions(depth: np.ndarray, camera: Mapping[str, Any]) -> np.ndarray:
    """(H, W, 3) points relative to a pinhole camera, world axes, from depth along its axis; fov is horizontal."""
    height, width = depth.shape
    forward = _unit(_vector(camera, "target", "position"))
    right = _unit(np.cross(forward, np.asarray(camera["up"], dtype=np.float64)))
    half = np.tan(np.radians(camera["fov"]) / 2)
    across = (2 * (np.arange(width) + 0.5) / width - 1) * half
    down = (2 * (np.arange(height) + 0.5) / height - 1) * half * height / width
    rays = forward + across[None, :, None] * right - down[:, None, None] * np.cross(right, forward)
    return depth[..., None] * rays


def surface_checks(found: Sequence[SurfaceFacts]) -> list[Check]:
    """Every rule of surfaces over a dataset's examples."""
    reach = {one.key: one.reach for one in found if np.isfinite(one.reach)}
    cosine = [one.cosine for one in found if np.isfinite(one.cosine)]
    far = max(reach, key=lambda key: reach[key], default="")
    return [REACH.judge(reach[far], f"example {far}") if reach else REACH.pass_over("there is no depth"),
            NORMALS.judge(float(np.quantile(cosine, 0.05))) if cosine else NORMALS.pass_over("no depth with normals")]


def _median_cosine(depth: np.ndarray, normal: np.ndarray, whole: np.ndarray, camera: Mapping[str, Any]) -> float:
    points = positions(depth, camera)
    down, across = (np.gradient(points, axis=axis) for axis in (0, 1))
    spanned = np.cross(down, across)
    length, spread = np.linalg.norm(normal, axis=2), np.linalg.norm(spanned, axis=2)
    usable = eroded(whole, 1) & (length > SMOOTH) & (spread > 0)
    if usable.sum() < MIN_PIXELS:
        return float("nan")
    return float(np.median((spanned * normal).sum(axis=2)[usable] / (length * spread)[usable]))


def _vector(camera: Mapping[str, Any], to: str, start: str) -> np.ndarray:
    return np.subtract(camera[to], camera[start], dtype=np.float64)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)
