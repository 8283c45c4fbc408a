"""Mitsuba plugins of this package, registered once per process and variant."""

from functools import cache

import mitsuba as mi

from dataset_builder.rendering import integrator, surface


def register() -> None:
    """Make `threedf_surface` and `threedf_lighting` known to Mitsuba; the variant must be set."""
    _register(mi.variant())


@cache
def _register(variant: str) -> None:
    surface.register()
    integrator.register()
