"""What a ray sees of a field."""

from __future__ import annotations

from collections.abc import Callable

import mitsuba as mi

from dataset_builder.assets.field_file import FieldFile

Look = Callable[[mi.Point3f, mi.Vector3f, mi.Bool], tuple[mi.Color3f, mi.Float]]
"""Origin and unit direction of rays in the frame of a field's file, metres, and which are active -> linear radiance
times opacity, in the light of the field's images, and opacity in [0, 1]."""


def look_of(file: FieldFile) -> Look:
    """What rays see of a field."""
    raise NotImplementedError
