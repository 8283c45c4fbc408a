"""What the verb `import capture` does with a file of splats."""

import argparse
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.errors import UserError, printable

if TYPE_CHECKING:
    from dataset_builder.importing.captures.photographs import Ball

PHOTOGRAPHS = ("distance", "images", "frame", "skip-bad", "size", "field", "steps", "seed", "no-sheet")
"""Options that mean nothing for splats."""
LEAST_CELLS, MOST_CELLS = 16, 512


def run(options: argparse.Namespace, crop: "Ball | None") -> int:
    """Import a file of splats with the options of the verb. crop: what they say to take. Raises UserError for those
    that are for photographs."""
    from dataset_builder.importing.splat_import import SplatJob, import_splats
    from dataset_builder.rendering.backend import activate
    from dataset_builder.rendering.field.splat_field import CELLS

    for name in PHOTOGRAPHS:
        if (given := getattr(options, name.replace("-", "_"))) is not None and given is not False:
            raise UserError(f"--{name}: expected none with a file of splats; it is for photographs")
    if options.up == "plane":
        raise UserError("--up plane: expected X,Y,Z with a file of splats; it is for photographs")
    cells = CELLS if options.resolution is None else options.resolution
    if not LEAST_CELLS <= cells <= MOST_CELLS:
        raise UserError(f"--resolution: expected {LEAST_CELLS} to {MOST_CELLS}, got {cells}")
    up = None if options.up == "cameras" else common.numbers("--up", options.up, 3)
    activate(options.backend)
    done = import_splats(SplatJob(
        file=options.folder, out=options.out, name=options.name or options.folder.stem, licence=options.licence.strip(),
        category=options.category.strip() or options.name or options.folder.stem, yaw=options.yaw,
        height=options.height, white=options.white, srgb=False if options.linear else None, cells=cells,
        up=None if up is None else (up[0], up[1], up[2]),
        box=crop.box if crop else None, ball=(*crop.centre, crop.radius) if crop and not crop.box else None))
    width, depth, height = done.size
    lines = [*done.notes, f"{done.splats:,} splats; mesh of {done.triangles:,} triangles, {width:.2f} x {depth:.2f} x "
             f"{height:.2f} m, {done.record.bodies} parts, {done.record.bodies_dropped} dropped; its silhouettes fill "
             f"the splats to IoU {done.record.silhouette_iou:.2f}", *map(str, done.files)]
    console = common.wide_console()
    for line in lines:
        console.print(printable(line), highlight=False, markup=False, soft_wrap=True)
    return 0
