"""What a way to look at fields is."""

from __future__ import annotations

from collections.abc import Callable

import mitsuba as mi

Look = Callable[["mi.Point3f", "mi.Vector3f", "mi.Bool"], "tuple[mi.Color3f, mi.Float]"]
"""Origins and unit directions of rays in the frame of a field's file, metres, and whether they count -> linear radiance
times opacity, in the light of the field's images, and opacity in [0, 1]."""
