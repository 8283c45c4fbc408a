"""Parts of one colour throughout and without a material -> parts with a material of that colour."""

from dataclasses import replace

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.assets.file_model import ROUGHNESS, FileMaterial, FileModel, FilePart, unique
from dataset_builder.tonemap import srgb


def with_even_colours(model: FileModel) -> FileModel:
    """The model with a material for each colour that is all that some part without a material has; see `name_of`."""
    materials, parts = list(model.materials), list[FilePart]()
    names, numbers = {each.material.name for each in materials}, dict[bytes, int]()
    for part in model.parts:
        color = _even(part)
        if color is None:
            parts.append(part)
            continue
        if color.tobytes() not in numbers:
            numbers[color.tobytes()] = len(materials)
            *base, alpha = color.tolist()
            name = unique(name_of(color), names)
            materials.append(FileMaterial(material=Material(name=name, base_color=(base[0], base[1], base[2]),
                                                            roughness=ROUGHNESS, alpha=alpha)))
        parts.append(replace(part, material=numbers[color.tobytes()], colors=None))
    return replace(model, parts=tuple(parts), materials=tuple(materials))


def name_of(color: np.ndarray) -> str:
    """What the material of a colour, linear Rec.709 and coverage (4,), is called: by its sRGB bytes, and where it does
    not cover all, that of coverage.

    >>> name_of(np.array([1, 0.2158605, 0, 1])), name_of(np.array([1, 0.2158605, 0, 0.5]))
    ('colour ff8000', 'colour ff800080')
    """
    shares = [*srgb(color[:3]), *([color[3]] if color[3] < 1 else [])]
    return f"colour {np.rint(255 * np.array(shares)).astype(np.uint8).tobytes().hex()}"


def _even(part: FilePart) -> np.ndarray | None:
    """(4,) the one colour of a part without a material; None for another part."""
    if part.material >= 0 or part.colors is None or not len(part.colors):
        return None
    first: np.ndarray = part.colors[0, 0].astype(np.float32) + 0.0
    return first if (part.colors == part.colors[0, 0]).all() else None
