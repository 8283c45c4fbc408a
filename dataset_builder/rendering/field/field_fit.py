"""A field fitted to posed images: stage by stage, one thread, the same bytes each time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import drjit as dr
import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.geometry.visual_hull import visual_hull
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.rendering.field.field_figures import held_out_figures
from dataset_builder.rendering.field.field_look import grid_look
from dataset_builder.rendering.field.field_mesh import FieldSurface, coloured, surface_of
from dataset_builder.rendering.field.field_pixels import chosen_images, fit_pixels
from dataset_builder.rendering.field.field_stages import stages_of
from dataset_builder.rendering.field.field_state import FitState
from dataset_builder.rendering.field.field_training import FitProgress, Told, trained

__all__ = ["FieldSettings", "FitProgress", "fit_field"]

LEAST_IMAGES = 8
LEAST_SIZE = 16
"""Pixels along the shorter side."""

@dataclass(frozen=True, kw_only=True)
class FieldSettings:
    """How a field is fitted."""

    kind: Literal["density", "sdf"]
    resolution: int
    """Cells along a side of its grid, from 32."""
    steps: int
    """Of all stages together, from 10."""
    seed: int
    """64 bits."""


def fit_field(images: PosedImages, held_out: PosedImages, settings: FieldSettings, *, centre: tuple[float, ...],
              radius: float, white: float, key: str, clean: TriangleMesh | None, checkpoint: Path | None,
              told: Told) -> FieldFile:
    """Fit a field to images and measure it on others, which may be none.

    centre, radius: of the ball that the object lies in, metres. white: radiance of white paper in the light of the
    images. key: goes to the record, and names the fit in its checkpoint. clean: what depth is compared with; None where
    there is nothing. checkpoint: a file that the state is kept in every 50 steps, and that a fit of the same key and
    settings goes on from; it is removed at the end. told: called every 50 steps and at the end.

    At most `field_pixels.MOST_IMAGES` images are read, one at a time. Equal arguments give equal bytes of
    `field_file.encode` on one machine, whatever the number of threads and wherever the fit was interrupted.
    Raises UserError: fewer than LEAST_IMAGES images, too small ones, none that shows the object, masks that no object
    agrees with, pixels that are not finite, a fit that explodes, a field without a surface.
    """
    where = f"field {key[:12]}"
    middle = np.array(centre, dtype=np.float64)
    _check(images, where)
    with one_thread():
        chosen = chosen_images(len(images.pixels))
        stages = stages_of(settings.kind, settings.resolution, settings.steps)
        base = fit_pixels(images, chosen, centre=middle, radius=radius, white=white, seed=settings.seed, where=where)
        hull = visual_hull(images, chosen, stages[0].resolution, centre=middle, radius=radius)
        if not hull.any():
            raise UserError(f"{where}: expected masks that some object agrees with, got {len(chosen)} images whose "
                            "masks have no point of the ball in common (check poses: their axes, and whether they lead "
                            "from the camera or to it)")
        state = FitState.begun(f"{key} {settings}", checkpoint)
        values = trained(stages, state, base, hull, seed=settings.seed, where=where, told=told)
        surface = surface_of(values[..., 0], settings.kind, images, chosen, centre=middle, radius=radius, where=where)
        draft = FieldFile(record=_record(settings, surface, key, images, len(chosen), state), mesh=surface.mesh,
                          centre=(float(middle[0]), float(middle[1]), float(middle[2])), radius=radius, white=white,
                          grid=values, numbers={"scale": white, "sharpness": stages[-1].sharpness[1]})
        look = grid_look(draft)
        figures = held_out_figures(look, surface.mesh, held_out, white=white, radius=radius, clean=clean)
        mesh = coloured(surface.mesh, look, cell=2 * radius / settings.resolution, white=white)
        state.remove()
        record = draft.record.model_copy(update={"truth": clean is not None, **vars(figures)})
        return replace(draft, record=record, mesh=mesh)


def _check(images: PosedImages, where: str) -> None:
    count, height, width = images.pixels.shape[:3]
    if count < LEAST_IMAGES:
        raise UserError(f"{where}: expected at least {LEAST_IMAGES} images, got {count} (a field needs views from all "
                        "sides)")
    if min(height, width) < LEAST_SIZE:
        raise UserError(f"{where}: expected at least {LEAST_SIZE} pixels along a side of images, got {width} x "
                        f"{height}")


def _record(settings: FieldSettings, surface: FieldSurface, key: str, images: PosedImages, views: int,
            state: FitState) -> FieldRecord:
    """The record without what is known of images that were held out."""
    return FieldRecord(key=key, kind=settings.kind, truth=False, views=views, held_out=0, width=images.pixels.shape[2],
                       resolution=settings.resolution, psnr=0, psnr_worst=0, ssim=0, opacity_iou=0,
                       silhouette_iou=surface.silhouette_iou, level=surface.level, bodies=surface.bodies,
                       bodies_dropped=surface.dropped, depth_95=0, loss=float(np.mean(state.losses)))


@contextmanager
def one_thread() -> Iterator[None]:
    """Dr.Jit with one thread: sums of floats that several threads add to depend on which comes first."""
    threads = dr.thread_count()
    dr.sync_thread()
    dr.set_thread_count(1)
    try:
        yield
    finally:
        dr.sync_thread()
        dr.set_thread_count(threads)
