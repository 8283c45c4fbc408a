"""The folder of 3D-FUTURE models: which there are, what each is, and which can be targets."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.assets.scene_readers.front3d_models import categories_of, category_word
from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.front3d_references import (
    MODEL_FILES,
    MODEL_LIST,
    folder_name,
    front3d_document,
    model_file,
)
from dataset_builder.spec.usual_sizes import usual_of, words_of

GROUPS = {"chair": ("chair", "armchair"), "sofa": ("sofa",), "table": ("table", "desk"),
          "cabinet": ("cabinet", "wardrobe", "bookshelf", "nightstand"), "bed": ("bed", "bunk bed", "crib"),
          "stool": ("stool", "ottoman", "bench"), "lamp": ("lamp", "floor lamp")}
"""Groups that targets are taken from by turns, each with what it holds. All of it stands on floors; rugs, curtains and
pictures are not seen from all sides."""
HANGING = {"pendant", "ceiling", "wall", "chandelier", "spotlight", "hanging"}
"""Words for what does not stand."""
SEVERAL = {"cabinet/shelf/desk": "cabinet", "sideboard/side cabinet/console table": "cabinet",
           "bookcase/jewelry armoire": "bookshelf"}
"""Categories that name several things, of which the last would mislead; as `category_word` has them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FutureModel:
    """A model that is there."""

    jid: str
    file: Path
    """Its OBJ file."""
    category: str = ""
    """As `model_info.json` has it, in lower case; empty where it says nothing."""


def find_future_models(folder: Path | None, info: Path | None) -> dict[str, FutureModel]:
    """Models of a folder by their id, with the categories that `info` has, or `model_info.json` in the folder where
    none is named. Without a folder there are none. Raises UserError where the folder, or the file that is named, is not
    there or cannot be read, and for a file without a folder.
    """
    if folder is None:
        if info is not None:
            raise UserError([Problem(where=str(info), path="--model-info", rule="expected --models beside it, got none",
                                     hint="name the folder of the models")])
        return {}
    try:
        with os.scandir(folder) as entries:
            files = {entry.name: model_file(folder, entry.name) for entry in entries if folder_name(entry.name)}
    except OSError as error:
        rule = f"expected the folder of the models, got: {error.strerror}"
        raise UserError([Problem(where=str(folder), path="--models", rule=rule,
                                 hint=f"name the folder that holds ID/{MODEL_FILES[0]}")]) from error
    names = sorted(name for name, file in files.items() if file)
    if not names:
        rule = f"expected folders that hold a {MODEL_FILES[0]}, found none"
        raise UserError([Problem(where=str(folder), path="--models", rule=rule, hint=_deeper(folder))])
    told = _categories(info or folder / MODEL_LIST, required=info is not None)
    return {name: FutureModel(jid=name, file=file, category=told.get(name, "")) for name in names
            if (file := files[name])}


def _deeper(folder: Path) -> str:
    """Where they may lie instead."""
    below = sorted(path.parent.parent for path in folder.glob(f"*/*/{MODEL_FILES[0]}"))
    return f"perhaps {below[0]}" if below else "name the folder that the archives of 3D-FUTURE were unpacked into"


def _categories(path: Path, *, required: bool) -> dict[str, str]:
    """Category of each model that is listed."""
    try:
        entries = front3d_document(path)
        if not isinstance(entries, list):
            raise ValueError(f"expected a list of models, got a {type(entries).__name__}")
    except FileNotFoundError as error:
        if not required:
            return {}
        raise UserError([Problem(where=str(path), path="--model-info", rule="expected a file, found none")]) from error
    except (OSError, ValueError) as error:
        rule = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise UserError([Problem(where=str(path), path="", rule=rule,
                                 hint="name another with --model-info")]) from error
    return {jid: listed.category for jid, listed in categories_of(entries).items()}


def target_group(category: str) -> tuple[str, str]:
    """The group of `GROUPS` that a category of 3D-FUTURE is of, and its word for specs; both empty where things of
    this category make no targets.

    >>> target_group("King-size Bed"), target_group("Lounge Chair / Cafe Chair / Office Chair")
    (('bed', 'bed'), ('chair', 'chair'))
    >>> target_group("Pendant Lamp"), target_group("Lighting"), target_group("Floor Lamp")
    (('', ''), ('', ''), ('lamp', 'floor lamp'))
    """
    usual = usual_of(SEVERAL.get(category_word(category), category))
    if usual is None or HANGING & set(words_of(category)):
        return "", ""
    return next(((group, usual.name) for group, names in GROUPS.items() if usual.name in names), ("", ""))


def category_in(models: Mapping[str, FutureModel], jid: str, scene_says: str) -> str:
    """What a piece is: by its model, else as the scene file says."""
    model = models.get(jid)
    return (model.category if model else "") or category_word(scene_says)
