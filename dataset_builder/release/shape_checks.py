"""Do mask, depth, normals and the camera of the label describe one object, where the picture has it?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_label import RenderRecord
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.release.cells import WHOLE, eroded
from dataset_builder.release.dataset_check import Check, Rule

SEARCH = 12
"""Pixels each way that a better place of the mask is looked for."""
FRAME = 2
"""Pixels along the frame's border whose outlines are cut, not seen."""
DARKEST = 1e-4
MIN_SIDE, MIN_EXAMPLES = 3 * SEARCH, 6
"""Pixels of the shorter side of the frame, and examples, below which edges are not judged."""
STEEPEST = 1.0
"""Of a change of log I_s from pixel to pixel: beyond it an edge is an edge."""

SMOOTH = 0.9
"""Least length of a mean normal: below, the pixel sees several faces."""
MIN_PIXELS = 20
"""Of an example that has an angle or a reach of its own."""
FAR = 0.98
"""Quantile of pixels that an example's reach is taken at."""

SUPPORT = Rule(name="support", high=0.01, why="0 by definition: D + R of what a ray meets is not 0",
               statement="share of pixels with mask > 0 where d and r are 0: maximum over examples, leaving out the "
                         "worst 5%")
DRIFT = Rule(name="drift", high=1.5, why="noise moves outlines equally to all sides: 0 apart from chance",
             statement="median shift of mask_rough's centre against mask's, in pixels")
EDGES = Rule(name="edges", high=1.5, why="0: most outlines are edges of the picture, and a shifted outline meets fewer",
             statement="shift of the mask at which its outline meets most edges of i_s, in pixels")
REACH = Rule(name="depth", high=2.0, why="the camera aims into the object's bounding sphere, and the object fills it",
             statement="distance along the view axis from depth to the camera's aim in bounding radii, largest of all")
NORMALS = Rule(name="normals", low=0.9, why="1 on flat faces; smooth shading and noise bring little below",
               statement="cosine between normal and the normal of the surface that depth spans, 5% quantile of "
                         "examples' medians")
RULES = (SUPPORT, DRIFT, EDGES, REACH, NORMALS)


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """What one example's layers say about its outline."""

    key: str
    bare: float
    """Share of the mask's pixels without d and r."""
    drift: np.ndarray
    """(2,) rows and columns from the centre of mask to that of mask_rough, NaN without one."""
    edges: np.ndarray
    """(25, 25) steepness of log i_s under the outline of a mask that is shifted by -12 to 12 rows and columns, over its
    mean in the frame; 0 where frame or outline are too small."""


def outline_of(key: str, layers: Mapping[str, np.ndarray]) -> Outline:
    """What an example's (H, W, C) layers say about its outline."""
    mask = layers["mask"][..., 0].astype(np.float64)
    inside, nothing = mask > 0, (layers["d"] + layers["r"]).sum(axis=2) == 0
    drift = np.full(2, np.nan)
    if "mask_rough" in layers and layers["mask_rough"].any() and inside.any():
        drift = _centre(layers["mask_rough"][..., 0].astype(np.float64)) - _centre(mask)
    return Outline(key=key, bare=float((inside & nothing).sum() / max(inside.sum(), 1)), drift=drift,
                   edges=edge_scores(layers["i_s"], mask))


def edge_scores(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(2 SEARCH + 1, 2 SEARCH + 1) steepness of the image's logarithm under the shifted outline; correlation by FFT."""
    steep = np.minimum(_steepness(np.log(np.maximum(image.sum(axis=2, dtype=np.float64), DARKEST))), STEEPEST)
    outline = _steepness(mask)
    seen = np.zeros_like(outline)
    seen[FRAME:-FRAME, FRAME:-FRAME] = outline[FRAME:-FRAME, FRAME:-FRAME]
    shifts = np.arange(-SEARCH, SEARCH + 1)
    if min(mask.shape) < MIN_SIDE or not seen.any() or not steep.any():
        return np.zeros((len(shifts), len(shifts)))
    product = np.fft.rfft2(steep) * np.conj(np.fft.rfft2(seen / seen.sum()))
    return np.fft.irfft2(product, s=steep.shape)[np.ix_(shifts, shifts)] / steep.mean()


def outline_checks(found: Sequence[Outline]) -> list[Check]:
    """Every rule of outlines over a dataset's examples."""
    bare = {outline.key: outline.bare for outline in found if outline.bare > SUPPORT.high}
    worst = float(np.quantile([outline.bare for outline in found], 0.95)) if found else 0.0
    return [SUPPORT.judge(worst, ", ".join(f"{key} ({share:.1%})" for key, share in bare.items())), _drift(found),
            _edges(found)]


def _drift(found: Sequence[Outline]) -> Check:
    drifts = np.array([outline.drift for outline in found if np.isfinite(outline.drift).all()]).reshape(-1, 2)
    if not len(drifts):
        return DRIFT.pass_over("there is no mask_rough")
    rows, columns = np.median(drifts, axis=0)
    return DRIFT.judge(float(np.hypot(rows, columns)), f"{rows:+.2f} rows, {columns:+.2f} columns")


def _edges(found: Sequence[Outline]) -> Check:
    scores = sum((outline.edges for outline in found), np.zeros((2 * SEARCH + 1, 2 * SEARCH + 1)))
    if (seen := sum(bool(outline.edges.any()) for outline in found)) < MIN_EXAMPLES:
        return EDGES.pass_over(f"{seen} examples with an outline in a frame of {MIN_SIDE} pixels or more, needs "
                               f"{MIN_EXAMPLES}")
    rows, columns = (int(i) - SEARCH for i in np.unravel_index(scores.argmax(), scores.shape))
    here, there = scores[SEARCH, SEARCH] / np.median(scores), scores.max() / np.median(scores)
    return EDGES.judge(float(np.hypot(rows, columns)), f"best {there:.2f} times the mean at {rows:+d} rows, "
                                                       f"{columns:+d} columns; {here:.2f} times where it is")


def _centre(mask: np.ndarray) -> np.ndarray:
    rows, columns = mask.sum(axis=1), mask.sum(axis=0)
    return np.array([rows @ np.arange(len(rows)), columns @ np.arange(len(columns))]) / mask.sum()


def _steepness(image: np.ndarray) -> np.ndarray:
    return np.hypot(*np.gradient(image))


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
