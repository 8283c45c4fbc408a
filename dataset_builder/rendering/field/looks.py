"""What rays see of a field, whatever kind it is of."""

from __future__ import annotations

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.rendering.field.field_look import Look, grid_look

__all__ = ["Look", "look_of"]


def look_of(file: FieldFile) -> Look:
    """What rays see of a field."""
    return grid_look(file)
