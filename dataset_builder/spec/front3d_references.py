"""Scenes of 3D-FRONT: the JSON of one, within bounds, and the models and textures that it needs."""

import json
import os
import re
import sys
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from dataset_builder.digest import read_regular
from dataset_builder.spec.file_reference import FileReference, is_inside
from dataset_builder.spec.obj_references import obj_references

MOST_SCENE_BYTES = 2**26
"""Of a scene; real ones have 5 to 20 MB."""
MOST_CONTAINERS = 2**20
"""Objects and lists of a scene; real ones have some ten thousand."""
FOLDER_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}")
"""What a jid may be: the name of a folder, nothing that leads elsewhere."""
MODEL_FILES = ("raw_model.obj", "normalized_model.obj")
"""Of a folder of 3D-FUTURE, the first that is there."""
TEXTURE_FILE, MODEL_LIST = "texture.png", "model_info.json"
ARRAYS = ("xyz", "normal", "uv", "faces")
"""Keys of a mesh that hold long lists."""
Hook = Callable[[dict[str, Any]], Any]


def front3d_document(path: Path, hook: Hook | None = None, *, without: tuple[str, ...] = (),
                     most: int = MOST_SCENE_BYTES) -> Any:
    """The JSON of a file of the data set, every object passed through `hook` once it is read, the innermost first.

    without: keys of lists of numbers that are taken for empty unread, which saves most of the time. NaN, Infinity and
    bytes that are no UTF-8 are survived. Raises ValueError, with the line and column, for what is no JSON, and for what
    is too large; OSError where it cannot be read.
    """
    data = read_regular(path, most=most)
    if without:
        keys = "|".join(without).encode()
        data = re.sub(rb'(?<!\\)("(?:' + keys + rb')"\s*:\s*\[)[-+0-9.eE,\s"nulNaIfity]*+\]', rb"\1]", data)
    containers = data.count(b"{") + data.count(b"[")
    if containers > MOST_CONTAINERS:
        raise ValueError(f"expected at most {MOST_CONTAINERS:,} objects and lists, got {containers:,}")
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        raise ValueError("expected text in UTF-8, got UTF-16: save it as UTF-8")
    text = data.decode("utf-8-sig", errors="replace")
    del data
    try:
        return json.loads(text, object_hook=hook)
    except json.JSONDecodeError as error:
        if without:
            return front3d_document(path, hook, most=most)  # It tells the place in the whole file
        end = text.rstrip()
        cut = "" if end.endswith(("}", "]")) and error.pos < len(end) else "; the file ends early: copy it again"
        raise ValueError(f"line {error.lineno}, column {error.colno}: expected JSON, got: {error.msg}{cut}") from error
    except RecursionError as error:
        raise ValueError("expected JSON that is not nested without end") from error
    except ValueError as error:  # Python reads no whole number of more digits
        raise ValueError(f"expected numbers of at most {sys.get_int_max_str_digits():,} digits, got more") from error


def folder_name(jid: Any) -> str:
    """A jid that may name a folder; empty for "local" and for what may not."""
    return jid if isinstance(jid, str) and jid != "local" and FOLDER_NAME.fullmatch(jid) else ""


def model_file(models: Path, jid: str) -> Path | None:
    """The OBJ file of a model, None where none is in the folder of models."""
    return next(filter(None, (_inside(models, jid, name) for name in MODEL_FILES)), None)


def texture_file(textures: Path | None, jid: str) -> Path | None:
    """The image of a material, None where none is in the folder of textures."""
    return None if textures is None else _inside(textures, jid, TEXTURE_FILE)


def texture_ids(material: dict[str, Any]) -> tuple[str, ...]:
    """Folders that may hold the texture of a material: its jid, and in older files the last folder of the address."""
    address = material.get("texture")
    parts = address.split("/") if isinstance(address, str) and len(address) < 1000 else []
    return tuple(dict.fromkeys(filter(None, map(folder_name, (material.get("jid"), *parts[-2:-1])))))


def _inside(folder: Path, jid: str, name: str) -> Path | None:
    """A file in a folder of that name; links that lead out of `folder` are not followed."""
    file = folder / jid / name
    return file if folder_name(jid) and is_inside(folder, f"{jid}/{name}") and file.is_file() else None


def front3d_references(path: Path, models: Path | None, textures: Path | None) -> Iterator[FileReference]:
    """The files that a scene needs and that are there, each once: the list of models, the OBJ files of its furniture
    with their libraries and textures, and the textures of its materials. What is missing is a fault of the scene that
    its reader names, and no error. Names are relative to the folder of the scene, and may begin with `..`.

    Raises ValueError and OSError as `front3d_document` does.
    """
    document = front3d_document(path, without=ARRAYS)
    found: dict[Path, tuple[str, str, bool]] = {}
    if models is not None:
        listed = models / MODEL_LIST
        if is_inside(models, MODEL_LIST) and listed.is_file():
            found[listed] = MODEL_LIST, MODEL_LIST, False
        for jid in _ids(document, "furniture", lambda each: (folder_name(each.get("jid")) * bool(each.get("valid")),)):
            file = model_file(models, jid)
            for each in [file, *_companions(file)] if file else []:
                found.setdefault(each, ("furniture", jid, each.suffix.lower() not in (".obj", ".mtl")))
    for jid in _ids(document, "material", texture_ids):
        if image := texture_file(textures, jid):
            found.setdefault(image, ("material", jid, True))
    for file, (key, written, image_file) in found.items():
        yield FileReference(by=path, key=key, written=written, name=os.path.relpath(file, path.parent),
                            image=image_file)


def _ids(document: Any, kind: str, get: Callable[[dict[str, Any]], tuple[str, ...]]) -> list[str]:
    """Folder names of the entries of a list, each once."""
    entries = document.get(kind) if isinstance(document, dict) else None
    found = (jid for entry in entries if isinstance(entry, dict) for jid in get(entry)) if isinstance(
        entries, list) else ()
    return list(dict.fromkeys(filter(None, found)))


def _companions(model: Path) -> list[Path]:
    """Libraries and textures of an OBJ file that are there; none where it cannot be understood, which its reader
    says."""
    try:
        files = [model.parent / reference.name for reference in obj_references(model)
                 if is_inside(model.parent, reference.name)]
        return [file for file in files if file.is_file()]
    except (OSError, ValueError):
        return []
