"""Make a field: take its images, fit it to them, and put it on the shelf, whole or not at all.

What is finished on the way lies beside it until then, so that an interrupted making goes on from there, and ends with
the same bytes.
"""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dataset_builder.assets.field_file import FieldFile, write_field
from dataset_builder.errors import OutputError, Problem, UserError
from dataset_builder.files import output_errors
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.lock import locked
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.rendering.field.field_fit import FieldSettings, fit_field
from dataset_builder.rendering.field.field_training import FitProgress
from dataset_builder.rendering.field_shelf import FieldProgress, FieldShelf, FieldTask
from dataset_builder.rendering.field_views import StudioCameras, studio, white_of
from dataset_builder.rendering.kept_images import KeptImages
from dataset_builder.seeding import derive_seed

MAKING, LOCK = ".making", ".lock"
CHECKPOINT = "fit.npz"


Told = Callable[[FieldProgress], None]


def untold(_: FieldProgress) -> None:
    """Tell nobody."""


def make_field(task: FieldTask, shelf: FieldShelf, mesh_root: Path, *, told: Told = untold) -> FieldFile:
    """A field from the shelf, made where it is missing or damaged; `backend.activate` must have run in this process.

    Whoever asks for a field that another process is at waits for that one. The bytes depend on the task and the
    shelf's `made_by` alone. Raises UserError, naming the object, where no field can be fitted, and for the own field of
    an object that is damaged; OutputError where the disk refuses.
    """
    path = shelf.path(task, mesh_root)
    if task.field.kind == "own":
        return shelf.get(task, mesh_root)
    making = path.with_name(shelf.key(task) + MAKING)
    with locked(path.with_name(shelf.key(task) + LOCK), folder=path.parent, work="making of a field", wait=True):
        if (found := shelf.find(task, mesh_root)) is None:
            with _cleared(making, task):
                found = _made(task, shelf.key(task), making, mesh_root, told)
                write_field(path, found)
    return found


@contextmanager
def _cleared(making: Path, task: FieldTask) -> Iterator[None]:
    """Let what was kept on the way go when a field is there, or when it cannot be; name the object then."""
    try:
        yield
    except OutputError:
        raise
    except UserError as error:
        shutil.rmtree(making, ignore_errors=True)
        raise UserError(Problem(where=task.object.name, path=problem.path, rule=problem.rule, hint=problem.hint)
                        for problem in error.problems) from error
    with output_errors(making):
        shutil.rmtree(making)


def _made(task: FieldTask, key: str, making: Path, mesh_root: Path, told: Told) -> FieldFile:
    plan = task.field
    cameras = StudioCameras.of(task.object, plan, mesh_root)
    images, held_out = _images(task, cameras, making, mesh_root, told)

    def fitting(news: FitProgress) -> None:
        told(FieldProgress(stage="fit", step=news.step, steps=news.steps, loss=news.loss, psnr=news.psnr))

    settings = FieldSettings(kind="sdf" if plan.kind == "sdf" else "density", resolution=plan.resolution,
                             steps=plan.steps, seed=derive_seed(int(plan.seed), "fit"))
    return fit_field(images, held_out, settings, centre=cameras.centre, radius=cameras.radius, white=white_of(plan),
                     key=key, clean=asset_of(task.object, mesh_root).mesh, checkpoint=making / CHECKPOINT, told=fitting)


def _images(task: FieldTask, cameras: StudioCameras, making: Path, mesh_root: Path,
            told: Told) -> tuple[PosedImages, PosedImages]:
    """Images to fit to, and images to measure on, those among them taken that are missing."""
    plan = task.field
    kept = KeptImages(making, plan.views + plan.held_out, plan.size)
    if missing := kept.missing():
        with studio(task.object, plan, cameras, mesh_root) as take:
            for count in kept.keep((number, take(number)) for number in missing):
                told(FieldProgress(stage="images", step=count, steps=len(kept.pixels)))
    return cameras.images(kept.pixels, slice(0, plan.views)), cameras.images(kept.pixels, slice(plan.views, None))
