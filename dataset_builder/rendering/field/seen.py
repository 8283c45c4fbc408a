"""The look of a field, whatever it is made of."""

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.rendering.field.field_look import grid_look
from dataset_builder.rendering.field.looks import Look
from dataset_builder.rendering.field.splat_look import splat_look


def look_of(file: FieldFile) -> Look:
    """What rays see of a field: of its grid, or of its splats."""
    return grid_look(file) if file.splats is None else splat_look(file)
