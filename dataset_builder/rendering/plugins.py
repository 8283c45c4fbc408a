"""Mitsuba plugins of this package, registered once per process and variant."""

from functools import cache

import mitsuba as mi

from dataset_builder.rendering.surface import bsdf
from dataset_builder.rendering.transport import integrator


def register() -> None:
    """Make `threedf_surface` and `threedf_lighting` known to Mitsuba; the variant must be set."""
    _register(mi.variant())


@cache
def _register(variant: str) -> None:
    bsdf.register()
    integrator.register()
