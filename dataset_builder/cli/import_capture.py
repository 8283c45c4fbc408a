"""The verb `import capture`: posed photographs, or splats, to a field with its mesh and an object spec."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.cli import common, import_splats
from dataset_builder.errors import UserError, printable

if TYPE_CHECKING:
    from dataset_builder.assets.field_file import FieldFile
    from dataset_builder.geometry.posed_images import PosedImages
    from dataset_builder.importing.capture_import import CaptureJob, Fit
    from dataset_builder.importing.captures.photographs import Ball
    from dataset_builder.rendering.field.field_training import FitProgress

VERB = "import capture"
"""Parsed as one word."""
_WORDS = VERB.split()
BOUNDS = {"size": (16, 2048), "resolution": (32, 512), "steps": (10, 100_000)}
"""Of options, as of the keys of a field in a spec."""
DEFAULTED = ("frame", "size", "field", "resolution", "steps", "seed")
"""Options whose defaults are those of `CaptureJob`."""


def one_verb(arguments: Sequence[str]) -> list[str]:
    """The command line with `import capture` as one word, where that is meant: a folder of models may be called
    capture, and then nothing but options follows."""
    alone = len(arguments) < 3 or arguments[2].startswith("-")
    if [*arguments[:2]] != _WORDS or (alone and Path(_WORDS[1]).exists()):
        return [*arguments]
    return [VERB, *arguments[2:]]


def add(verbs: common.Verbs) -> None:
    """Add the verb."""
    verb = common.add_verb(verbs, VERB, _import, "make an object of posed photographs: a field, its mesh and a spec")
    verb.add_argument("folder", type=Path, metavar="DIR",
                      help="folder of COLMAP, transforms.json or ActorsHQ, with its photographs; or a file of Gaussian "
                           "splats: .ply, .spz, .glb, .gltf, .usd")
    verb.add_argument("--licence", required=True, metavar="SPDX", help="licence of the photographs")
    verb.add_argument("--out", type=common.out_folder, default=Path("captures"), metavar="DIR",
                      help="folder for field, spec and contact sheet (default: captures)")
    verb.add_argument("--name", default="", help="of the object and its files (default: the folder's)")
    verb.add_argument("--category", default="", metavar="NAME", help="what the object is (default: its name)")
    length = verb.add_mutually_exclusive_group()
    length.add_argument("--height", type=float, metavar="METRES", help="how high the object is")
    length.add_argument("--distance", nargs=3, metavar=("A", "B", "METRES"),
                        help="between the cameras of two images, or two points of COLMAP such as point:7")
    verb.add_argument("--up", default="cameras", metavar="X,Y,Z",
                      help="what is up in the capture's frame; cameras: as these were held, plane: square to the plane "
                           "of most points (default: cameras; for splats, what usually is in such files)")
    verb.add_argument("--yaw", type=float, default=0.0, metavar="DEGREES",
                      help="turn about the vertical; at 0 the first image sees the front")
    verb.add_argument("--white", type=float, metavar="X",
                      help="linear value of white paper in the photographs (default: from their median)")
    where = verb.add_mutually_exclusive_group()
    where.add_argument("--ball", metavar="X,Y,Z,R", help="what to take of images without masks, in the capture's frame")
    where.add_argument("--box", metavar="X,Y,Z,X,Y,Z", help="the same, two opposite corners")
    verb.add_argument("--images", metavar="NAME", help="folder of the images of a COLMAP model, such as images_4")
    verb.add_argument("--frame", type=int, metavar="N", help="frame of a rig's cameras (default: 0)")
    verb.add_argument("--skip-bad", action="store_true", help="leave out images that cannot be used")
    verb.add_argument("--size", type=common.positive, metavar="N",
                      help="longest side of the images that are fitted, pixels (default: 256)")
    verb.add_argument("--field", choices=("density", "sdf"),
                      help="volume density, whose mesh is pitted, or signed distance, smooth (default: density)")
    verb.add_argument("--resolution", type=common.positive, metavar="N",
                      help="cells along a side of the field (default: 128)")
    verb.add_argument("--steps", type=common.positive, metavar="N", help="of the fit (default: 300)")
    verb.add_argument("--seed", type=int, help="of the fit (default: 0)")
    verb.add_argument("--linear", action="store_true",
                      help="colours of splats are linear, whatever their file says (default: as it says)")
    verb.add_argument("--no-sheet", action="store_true", help="draw no contact sheet")
    common.add_backend(verb)


def _import(options: argparse.Namespace) -> int:
    from dataset_builder.assets.splat_file import READERS
    from dataset_builder.importing.capture_import import import_capture

    if options.folder.suffix.lower() in READERS and not options.folder.is_dir():
        return import_splats.run(options, _ball(options))
    job = _job(options)
    done = import_capture(job, fit=_fitted(options.backend), picture=None if options.no_sheet else _sheet, told=_told)
    record, console = done.record, common.wide_console()
    held = (f"; {record.held_out} images held out are shown to {record.psnr:.1f} dB (worst {record.psnr_worst:.1f}), "
            f"opacity to IoU {record.opacity_iou:.2f}" if record.held_out else "; no image was held out")
    lines = [*done.notes, f"{record.kind} field of {record.views} images of {record.width} pixels{held}",
             f"mesh: fills the masks to IoU {record.silhouette_iou:.2f}, {record.bodies} parts, "
             f"{record.bodies_dropped} dropped", *(str(path) for path in done.files)]
    for line in lines:
        console.print(printable(line), highlight=False, markup=False, soft_wrap=True)
    return 0


def _job(options: argparse.Namespace) -> "CaptureJob":
    from dataset_builder.importing.capture_import import CaptureJob

    folder = options.folder.resolve()
    distance = None
    if options.distance:
        first, second, metres = options.distance
        distance = first, second, common.numbers("--distance", metres, 1)[0]
    if options.linear:
        raise UserError("--linear: expected none with photographs, which are taken to be sRGB; it is for splats")
    given = {name: value for name in DEFAULTED if (value := getattr(options, name)) is not None}
    for name, (least, most) in BOUNDS.items():
        if not least <= given.get(name, least) <= most:
            raise UserError(f"--{name}: expected {least} to {most}, got {given[name]}")
    return CaptureJob(
        folder=options.folder, out=options.out, name=options.name or (folder.name if folder.is_dir() else folder.stem),
        licence=options.licence.strip(), category=options.category.strip(), images=options.images,
        ball=_ball(options), yaw=options.yaw, height=options.height, distance=distance,
        up=options.up if options.up in ("cameras", "plane") else tuple(common.numbers("--up", options.up, 3)),
        white=options.white, skip=options.skip_bad, **given)


def _ball(options: argparse.Namespace) -> "Ball | None":
    from dataset_builder.importing.captures.photographs import Ball, boxed

    if options.ball:
        x, y, z, radius = common.numbers("--ball", options.ball, 4)
        if radius <= 0:
            raise UserError(f"--ball: expected a radius above 0, got {radius:g}")
        return Ball(centre=(x, y, z), radius=radius)
    return boxed(common.numbers("--box", options.box, 6)) if options.box else None


def _fitted(backend: str) -> "Fit":
    """What fits a field, on the backend that is asked for."""
    def fit(images: "PosedImages", held_out: "PosedImages", job: "CaptureJob", *, ball: "Ball", white: float, key: str,
            checkpoint: Path) -> "FieldFile":
        """The field of a job's images."""
        from dataset_builder.rendering.backend import activate

        activate(backend)
        from dataset_builder.rendering.field.field_fit import FieldSettings, fit_field

        settings = FieldSettings(kind=job.field, resolution=job.resolution, steps=job.steps, seed=job.seed)
        return fit_field(images, held_out, settings, centre=ball.centre, radius=ball.radius, white=white, key=key,
                         clean=None, checkpoint=checkpoint, told=_step_told)

    return fit


def _sheet(content: "FieldFile", images: "PosedImages", target: Path) -> bool:
    """Draw the contact sheet; a warning where that fails, since the object does not need it."""
    from dataset_builder.rendering.field.field_figures import looked_at
    from dataset_builder.rendering.field.seen import look_of
    from dataset_builder.report.capture_sheet import write_capture_sheet

    def shown(field: "FieldFile", few: "PosedImages") -> np.ndarray:
        return np.stack([*looked_at(look_of(field), few, np.arange(len(few.pixels)))])

    try:
        write_capture_sheet(content, images, target, shown=shown)
    except (UserError, OSError, ValueError, RuntimeError, ArithmeticError, MemoryError) as error:
        print(f"warning: no contact sheet ({error})", file=sys.stderr)
        return False
    return True


def _step_told(progress: "FitProgress") -> None:
    print(f"step {progress.step} of {progress.steps}: loss {progress.loss:.4f}, {progress.psnr:.1f} dB",
          file=sys.stderr, flush=True)


def _told(done: int, of: int) -> None:
    if done == of or done % 100 == 0:
        print(f"{done} of {of} photographs read", file=sys.stderr, flush=True)
