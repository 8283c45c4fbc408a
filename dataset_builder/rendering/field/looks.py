"""What rays see of a field, whatever kind it is of."""

from __future__ import annotations

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.rendering.field.field_look import Look, grid_look
from dataset_builder.rendering.field.splat_look import splat_look

__all__ = ["Look", "look_of"]


def look_of(file: FieldFile) -> Look:
    """What rays see of a field."""
    return splat_look(file) if file.splats is not None else grid_look(file)
