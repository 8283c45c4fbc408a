"""Which layout a folder has, and its capture."""

from pathlib import Path

from dataset_builder.assets.pose_readers.capture import Capture, problem
from dataset_builder.assets.pose_readers.colmap import read_colmap
from dataset_builder.assets.pose_readers.transforms_json import read_transforms
from dataset_builder.importing.captures.actors_hq import CALIBRATION, VIDEOS, read_actors_hq
from dataset_builder.spec.pose_files import model_folder, transforms_file

POSES = "sparse/0/cameras.bin (or .txt), transforms.json, or calibration.csv"
RECONSTRUCT = ("poses come from COLMAP: colmap automatic_reconstructor --workspace_path FOLDER --image_path "
               "FOLDER/images")


def read_capture(folder: Path, *, images: str | None = None, frame: int = 0) -> Capture:
    """The capture of a folder, whoever wrote it.

    images: name of the folder with the images of a COLMAP model, such as `images_4`. frame: of ActorsHQ's videos.
    Raises UserError where the folder holds no poses, or damaged ones.
    """
    if folder.suffix.lower() in VIDEOS:
        raise problem(folder, "expected a folder of photographs with their poses, got a video",
                      f"mkdir -p FOLDER/images; ffmpeg -i {folder} -vf fps=2 FOLDER/images/%05d.png; {RECONSTRUCT}")
    if not folder.is_dir():
        raise problem(folder, "expected a folder of photographs with their poses, found none")
    rig = (folder / CALIBRATION).is_file()
    colmap = not rig and not transforms_file(folder) and model_folder(folder)
    for option, given, fits, of in (("--images", images, colmap, "a COLMAP model"), ("--frame", frame, rig, "a rig")):
        if given and not fits:
            raise problem(folder, f"expected {of} where this option is given, got another capture", "leave it out",
                          path=option)
    if rig:
        found = read_actors_hq(folder, frame)
    elif transforms_file(folder):
        found = read_transforms(folder)
    elif colmap:
        found = read_colmap(folder, images)
    else:
        raise problem(folder, f"expected poses ({POSES}), found none", RECONSTRUCT)
    if not found.shots:
        raise problem(folder, "expected photographs with poses, found none", RECONSTRUCT)
    return found
