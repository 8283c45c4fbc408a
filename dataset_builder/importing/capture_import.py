"""A folder of posed photographs to a field with its mesh, and the object spec that names it."""

import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from dataset_builder.assets.field_file import GREY_CARD, FieldFile, encode, white_of_median
from dataset_builder.digest import digest
from dataset_builder.errors import Problem, UserError
from dataset_builder.files import output_errors, require_writable, write_atomic
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.importing.captures.darkroom import parted
from dataset_builder.importing.captures.find_capture import read_capture
from dataset_builder.importing.captures.photographs import Ball
from dataset_builder.importing.captures.pose_checks import camera_notes
from dataset_builder.importing.captures.review import Reviewed, reviewed, without_blur
from dataset_builder.importing.captures.settle import check_options, moved_poses, settled, spec_text
from dataset_builder.importing.captures.upright import CapturePlacement, metres_per_unit, turned, up_of
from dataset_builder.importing.in_place import move, refuse_existing
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.lock import locked

LEAST_PSNR = 22.0
"""dB of images that were held out, below which a field is told to be poor."""
SIZES = (0.01, 20.0)
"""Metres that an object is expected to be high."""


@dataclass(frozen=True, kw_only=True)
class CaptureJob:
    """What is asked for."""

    folder: Path
    out: Path
    name: str
    """Of the object and its files."""
    licence: str
    """SPDX identifier of the photographs."""
    category: str = ""
    """What the object is; empty for its name."""
    size: int = 256
    """Longest side of the images that are fitted, pixels."""
    images: str | None = None
    """Folder of the images of a COLMAP model."""
    frame: int = 0
    """Of videos of a rig."""
    ball: Ball | None = None
    """What to take of images without masks, in the capture's frame."""
    up: tuple[float, ...] | Literal["cameras", "plane"] = "cameras"
    yaw: float = 0.0
    """Degrees that the object is turned about its vertical, from the first image's camera before its front."""
    height: float | None = None
    """Of the object, metres."""
    distance: tuple[str, str, float] | None = None
    """Two named cameras or points, and metres between them."""
    white: float | None = None
    """Linear value of white paper in the photographs; None to follow from their median."""
    field: Literal["density", "sdf"] = "density"
    resolution: int = 128
    steps: int = 300
    seed: int = 0
    skip: bool = False
    """Whether images that cannot be used are left out, instead of refused."""

    @property
    def files(self) -> tuple[str, str, str]:
        """Field, spec and contact sheet, in the output folder."""
        return f"{self.name}.npz", f"{self.name}.yaml", f"report/{self.name}.png"


class Fit(Protocol):
    """Fits a field to images about the ball (`centre`, `radius`)."""

    def __call__(self, images: PosedImages, held_out: PosedImages, job: CaptureJob, *, ball: Ball, white: float,
                 key: str, checkpoint: Path) -> FieldFile: ...


Picture = Callable[[FieldFile, PosedImages, Path], bool]
"""Draws photographs, the field and the mesh from the same cameras into a file; whether it could."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportedCapture:
    """What was written."""

    files: tuple[Path, ...]
    record: FieldRecord
    notes: tuple[str, ...]


def import_capture(job: CaptureJob, *, fit: Fit, picture: Picture | None,
                   told: Callable[[int, int], None] = lambda done, of: None) -> ImportedCapture:
    """Write a field, its spec and a contact sheet for the photographs of a folder.

    Pixels and the state of the fit are in a work folder in the output folder meanwhile, from which an interrupted
    import goes on. Raises UserError, with nothing written, for whatever is wrong with capture or options, or where a
    file is there already.
    """
    check_options(licence=job.licence, name=job.name, yaw=job.yaw, seed=job.seed, numbers={
        "--height": job.height, "--white": job.white, "--distance": job.distance and job.distance[2]})
    refuse_existing(job.out, job.files)
    capture = read_capture(job.folder, images=job.images, frame=job.frame)
    scale, scale_said = metres_per_unit(capture, job.distance)
    if not scale and job.height is None:
        raise UserError([Problem(where=str(job.folder), path="", rule="expected a length, since the poses of "
                                 f"{capture.layout} have no units", hint="give --height METRES of the object, or "
                                 "--distance A B METRES between two cameras or points")])
    require_writable(job.out)
    work = job.out / f".{job.name}-capture"
    with locked(job.out / f".{job.name}-capture.lock", folder=job.out, work="import"):
        done = reviewed(capture, str(job.folder), size=job.size, ball=job.ball, skip=job.skip, work=work, told=told)
        placement, notes = _placed(done, job, scale, scale_said)
        fitted, held = (replace(images, poses=placement.poses(images.poses))
                        for images in parted(done.roll, done.kept, done.gains, work))
        white, said = _white(job, done)
        x, y, z = placement.points(np.array(done.ball.centre)).tolist()
        made = fit(fitted, held, job, ball=Ball(centre=(x, y, z), radius=placement.scale * done.ball.radius),
                   white=white, key=_key(job, done, placement, white), checkpoint=work / "fit")
        content = settled(replace(made, record=made.record.model_copy(update={"truth": False, "masked": done.masked})),
                          job.height)
        notes = (*notes, said, *_looked_at(content, job))
        names = _written(job, content, notes, replace(fitted, poses=moved_poses(fitted.poses, made, content)),
                         work / "made", picture)
        with output_errors(job.out):
            move(names, work / "made", job.out)
        shutil.rmtree(work, ignore_errors=True)
    return ImportedCapture(files=tuple(job.out / name for name in names), record=content.record, notes=notes)


def _placed(done: Reviewed, job: CaptureJob, scale: float, scale_said: str) -> tuple[CapturePlacement, tuple[str, ...]]:
    """Where the object stands, and what is to be told of the cameras. Where only a height is given, the ball is taken
    for as high, until the mesh is there."""
    up, up_said = up_of(done.capture, job.up, done.ball)
    centre = np.array(done.ball.centre)
    capture = without_blur(done)
    first = capture.shots[0]
    turn = turned(up, first.pose[:3, 3] - centre, job.yaw)
    if job.height is not None:
        scale, scale_said = job.height / (2 * done.ball.radius), f"scale from a height of {job.height:g} m"
    notes = (*done.notes, *camera_notes(capture, centre, up), up_said,
             f"front as {first.name} sees it" + f", turned by {job.yaw:g} degrees" * bool(job.yaw), scale_said)
    return CapturePlacement(turn=turn, scale=scale, origin=centre), notes


def _white(job: CaptureJob, done: Reviewed) -> tuple[float, str]:
    """Value of white paper in the photographs, and who says so."""
    if job.white is not None:
        return job.white, f"white of the photographs is {job.white:g}, as given"
    median = float(np.median((done.roll.median / done.gains)[list(done.kept)]))
    white = white_of_median(median)
    return white, (f"white of the photographs is taken to be {white:.3g}: their median luminance on the object, "
                   f"{median:.3g}, is taken for a reflectance of {GREY_CARD}; --white says better")


def _key(job: CaptureJob, done: Reviewed, placement: CapturePlacement, white: float) -> str:
    """Digest of all that the field is made from."""
    return digest({"seals": done.roll.seals, "kept": done.kept, "gains": done.gains.tolist(),
                   "turn": placement.turn.tolist(), "scale": placement.scale, "origin": placement.origin.tolist(),
                   "poses": done.roll.images.poses.tolist(), "focal": done.roll.images.focal.tolist(),
                   "ball": asdict(done.ball), "white": white, "size": job.size, "height": job.height,
                   "fit": [job.field, job.resolution, job.steps, job.seed]})


def _looked_at(content: FieldFile, job: CaptureJob) -> list[str]:
    """What is odd about the result."""
    record, high = content.record, content.mesh.size[2]
    notes = []
    if record.held_out and record.psnr < LEAST_PSNR:
        notes.append(f"held-out images are shown to {record.psnr:.1f} dB (expected {LEAST_PSNR:g}): look at "
                     f"{job.files[2]}")
    if not SIZES[0] <= high <= SIZES[1]:
        notes.append(f"the object is {high:.3g} m high (expected {SIZES[0]:g} to {SIZES[1]:g}): give --height")
    return notes


def _written(job: CaptureJob, content: FieldFile, notes: tuple[str, ...], images: PosedImages, folder: Path,
             picture: Picture | None) -> list[str]:
    """Write field, spec and contact sheet into a folder; their names."""
    field, spec, sheet = job.files
    write_atomic(folder / field, encode(content))
    write_atomic(folder / spec, spec_text(field, category=job.category or job.name, licence=job.licence,
                                          notes=notes).encode())
    drawn = picture is not None and picture(content, images, folder / sheet)
    return [field, spec, *([sheet] if drawn else [])]
