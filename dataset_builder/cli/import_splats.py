"""What the verb `import capture` does with a file of splats."""

import argparse

from dataset_builder.cli import common
from dataset_builder.errors import UserError, printable

FITTED = {"size": 256, "field": "density", "steps": 300, "seed": 0, "no_sheet": False}
"""Options that are about a fit, and their defaults."""


def run(options: argparse.Namespace) -> int:
    """Import a file of splats with the options of the verb. Raises UserError for those that are for photographs."""
    from dataset_builder.importing.splat_import import SplatJob, import_splats
    from dataset_builder.rendering.backend import activate

    for name, given in (("--distance", options.distance), ("--images", options.images), ("--frame", options.frame),
                        ("--skip-bad", options.skip_bad), ("--up plane", options.up == "plane"),
                        *((f"--{name.replace('_', '-')}", getattr(options, name) != default)
                          for name, default in FITTED.items())):
        if given:
            raise UserError(f"{name}: expected none with a file of splats; it is for photographs")
    box = common.numbers("--box", options.box, 6) if options.box else None
    ball = common.numbers("--ball", options.ball, 4) if options.ball else None
    up = None if options.up == "cameras" else common.numbers("--up", options.up, 3)
    activate(options.backend)
    done = import_splats(SplatJob(
        file=options.folder, out=options.out, name=options.name or options.folder.stem, licence=options.licence.strip(),
        category=options.category.strip() or options.name or options.folder.stem, yaw=options.yaw,
        height=options.height, white=options.white, srgb=False if options.linear else None, cells=options.resolution,
        up=None if up is None else (up[0], up[1], up[2]),
        ball=None if ball is None else (ball[0], ball[1], ball[2], ball[3]),
        box=None if box is None else ((min(box[0], box[3]), min(box[1], box[4]), min(box[2], box[5])),
                                      (max(box[0], box[3]), max(box[1], box[4]), max(box[2], box[5])))))
    width, depth, height = done.size
    lines = [*done.notes, f"{done.splats:,} splats; mesh of {done.triangles:,} triangles, {width:.2f} x {depth:.2f} x "
             f"{height:.2f} m, {done.record.bodies} parts, {done.record.bodies_dropped} dropped; its silhouettes fill "
             f"the splats to IoU {done.record.silhouette_iou:.2f}", *map(str, done.files)]
    console = common.wide_console()
    for line in lines:
        console.print(printable(line), highlight=False, markup=False, soft_wrap=True)
    return 0
