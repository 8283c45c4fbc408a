"""Do depth, normals and the camera of the label describe one surface?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.record import RenderRecord
from dataset_builder.release.cells import WHOLE, eroded
from dataset_builder.release.dataset_check import Check, Rule

SMOOTH = 0.9
"""Least length of a mean normal: below, the pixel sees several faces."""
MIN_PIXELS = 20
"""Of an example that has an angle or a reach of its own."""
FAR = 0.98
"""Quantile of pixels that an example's reach is taken at."""

REACH = Rule(name="depth", high=2.0, why="the camera aims into the object's bounding sphere, and the object fills it",
             statement="distance along the view axis from depth to the camera's aim in bounding radii, largest of all")
NORMALS = Rule(name="normals", low=0.9, why="1 on flat faces; smooth shading and noise bring little below",
               statement="cosine between normal and the normal of the surface that depth spans, 5% quantile of "
                         "examples' medians")
RULES = (REACH, NORMALS)


@dataclass(frozen=True, kw_only=True)
class SurfaceFacts:
    """What one example's surface is like; NaN where layers or label do not tell."""

    key: str
    reach: float
    """See `REACH`."""
    cosine: float
    """Median, see `NORMALS`."""


def surface_of(layers: Mapping[str, np.ndarray], plan: ExamplePlan, record: RenderRecord) -> SurfaceFacts:
    """What depth (H, W, 1), normal (H, W, 3), and the camera and bounding radius of the label say about each other."""
    if "depth" not in layers:
        return SurfaceFacts(key=plan.key, reach=float("nan"), cosine=float("nan"))
    depth, radius = layers["depth"][..., 0], record.bounding_radius
    camera = Pinhole.of(plan.camera, depth.shape[1], depth.shape[0])
    whole = layers["mask"][..., 0] >= WHOLE
    reach = cosine = float("nan")
    if radius > 0 and whole.sum() >= MIN_PIXELS:
        away = np.abs(depth[whole] - np.linalg.norm(camera.target - camera.position))
        reach = float(np.quantile(away, FAR) / radius)
    if "normal" in layers:
        cosine = _median_cosine(camera.unproject(depth), layers["normal"], whole)
    return SurfaceFacts(key=plan.key, reach=reach, cosine=cosine)


def surface_checks(found: Sequence[SurfaceFacts]) -> list[Check]:
    """Every rule of surfaces over a dataset's examples."""
    reach = {one.key: one.reach for one in found if np.isfinite(one.reach)}
    cosine = [one.cosine for one in found if np.isfinite(one.cosine)]
    far = max(reach, key=lambda key: reach[key], default="")
    return [REACH.judge(reach[far], f"example {far}") if reach else REACH.pass_over("there is no depth"),
            NORMALS.judge(float(np.quantile(cosine, 0.05))) if cosine else NORMALS.pass_over("no depth with normals")]


def _median_cosine(points: np.ndarray, normal: np.ndarray, whole: np.ndarray) -> float:
    down, across = (np.gradient(points, axis=axis) for axis in (0, 1))
    spanned = np.cross(down, across)
    length, spread = np.linalg.norm(normal, axis=2), np.linalg.norm(spanned, axis=2)
    usable = eroded(whole, 1) & (length > SMOOTH) & (spread > 0)
    if usable.sum() < MIN_PIXELS:
        return float("nan")
    return float(np.median((spanned * normal).sum(axis=2)[usable] / (length * spread)[usable]))
