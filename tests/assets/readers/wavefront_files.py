"""Small OBJ and MTL files for tests."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.assets.file_model import FileMaterial, FileModel
from dataset_builder.assets.readers.obj import read

TRIANGLE = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"


def png(texels: Any) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.asarray(texels, dtype=np.uint8)).save(stream, "PNG")
    return stream.getvalue()


def obj(folder: Path, text: str | bytes, **libraries: str | bytes) -> FileModel:
    """What the reader makes of `a.obj` beside libraries, such as `b="newmtl m"` for `b.mtl`."""
    for name, content in {"a.obj": text, **{f"{name}.mtl": each for name, each in libraries.items()}}.items():
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return read(folder / "a.obj", 64)


def mtl(folder: Path, text: str | bytes) -> FileMaterial:
    """What it makes of the statements of a material on a triangle."""
    data = text.encode() if isinstance(text, str) else text
    return obj(folder, TRIANGLE, a=b"newmtl m\n" + data).materials[0]
