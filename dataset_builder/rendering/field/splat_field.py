"""Splats out of a file -> the field of an object: chosen, turned, scaled, stood up, and meshed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import transform
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_crop import ball_about, cropped, main_body
from dataset_builder.geometry.splat_moves import moved
from dataset_builder.geometry.turns import upright
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.rendering.field.field_mesh import coloured
from dataset_builder.rendering.field.splat_look import splat_look, splat_sight
from dataset_builder.rendering.field.splat_mesh import splat_surface

CELLS = 128
"""Along a side of the grid that depths are fused in, and pixels along a side of their images."""
VIEWS = 64
"""All around, that depths are fused of."""
FEW = 64
"""Splats that may be of any size beside each other."""
WIDE = 0.2
"""Largest median scale of more than FEW, in diagonals of the box about their middles: beyond it a ray meets nearly all
of them, and each of its steps looks at all."""
FAR = 0.999
"""Share of the splats that the ball is made to hold which is meshed; the rest may lie far out."""


@dataclass(frozen=True, kw_only=True)
class SplatStance:
    """How an object stands in the cloud that it is taken from."""

    up: tuple[float, float, float]
    """What points up in the cloud's axes, of any length."""
    yaw: float = 0.0
    """Degrees that it is turned by when it stands, anticlockwise from above."""
    height: float | None = None
    """Of its mesh, metres."""
    scale: float | None = None
    """Metres to a unit of the cloud, where no height is given; 1 where neither is."""
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    """Lowest and highest corner of what is taken, in the cloud's units and axes."""
    ball: tuple[float, float, float, float] | None = None
    """Middle and radius of what is taken, in the cloud's units and axes."""
    largest: bool = True
    """Whether only the largest part of that is taken."""


def field_of_splats(cloud: SplatCloud, stance: SplatStance, *, key: str, white: float = 1.0,
                    cells: int = CELLS, views: int = VIEWS) -> FieldFile:
    """The field of an object that is splats, in the object's frame.

    Its record has no figures of a fit, which was made elsewhere; `silhouette_iou` compares the mesh with the opacities
    of the splats. white: radiance of white paper in the light of the capture. Raises UserError for a crop without
    splats, for a stance that is none, for splats as large as all of them together, and where nothing is opaque.
    """
    found = cropped(cloud, box=None if stance.box is None else np.array(stance.box),
                    ball=None if stance.ball is None else np.array(stance.ball))
    found = moved(main_body(found) if stance.largest else found, upright(stance.up, stance.yaw))
    low, high = np.quantile(found.centres.astype(np.float64), (1 - FAR, FAR), axis=0)
    _require_spread(found, float(np.linalg.norm(high - low)))
    # Half of the diagonal holds all but the farthest splats
    centre = (low + high) / 2
    radius = float(np.linalg.norm(high - low)) / 2 + 3 * float(np.median(found.scales.max(axis=1)))
    surface = splat_surface(splat_sight(found, centre, radius), centre=centre, radius=radius, cells=cells,
                            views=views)
    bounds = surface.mesh.bounds
    matrix = np.eye(4)
    matrix[:3, :3] *= _scale(stance, float(bounds[1, 2] - bounds[0, 2]))
    matrix[:3, 3] = -matrix[0, 0] * np.array([*bounds[:, :2].mean(axis=0), bounds[0, 2]])
    found, mesh = moved(found, matrix), transform(surface.mesh, matrix)
    centre = mesh.bounds.mean(axis=0)
    record = FieldRecord(
        key=key, kind="splats", truth=False, masked=False, views=0, held_out=0, width=cells, resolution=0, psnr=0.0,
        psnr_worst=0.0, ssim=0.0, opacity_iou=0.0, silhouette_iou=surface.silhouette_iou, level=0.0,
        bodies=surface.bodies, bodies_dropped=surface.dropped, depth_95=0.0, loss=0.0)
    bare = FieldFile(record=record, mesh=mesh, centre=(float(centre[0]), float(centre[1]), float(centre[2])),
                     radius=ball_about(found, centre), white=white, splats=found)
    cell = 2 * radius * matrix[0, 0] / cells
    return replace(bare, mesh=coloured(mesh, splat_look(bare), cell=cell, white=white))


def _require_spread(cloud: SplatCloud, diagonal: float) -> None:
    size = float(np.median(cloud.scales.max(axis=1)))
    if len(cloud) > FEW and size > WIDE * diagonal:
        raise UserError(f"splats: expected most of {len(cloud):,} to be small beside the whole, got a median size of "
                        f"{size:.3g} where middles lie within {diagonal:.3g} (scales in a .ply are logarithms)")


def _scale(stance: SplatStance, units: float) -> float:
    """Metres to a unit, of an object that is some units high."""
    if stance.height is not None and stance.scale is not None:
        raise UserError("expected a height or a scale, got both")
    found = stance.height / units if stance.height is not None else 1.0 if stance.scale is None else stance.scale
    if not 0 < found < np.inf:
        raise UserError(f"expected a height or a scale above 0, got {stance.height if stance.scale is None else found}")
    return found
