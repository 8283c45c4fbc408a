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
    mi.register_bsdf(bsdf.PLUGIN, plugin_class(bsdf.Surface, mi.BSDF))
    mi.register_integrator(integrator.PLUGIN, plugin_class(integrator.LightingIntegrator, mi.SamplingIntegrator))


def plugin_class(methods: type, base: type) -> type:
    """A subclass of `base`, a class of Mitsuba's, that has everything the plain class `methods` has.

    Mitsuba's classes exist only where a variant is set, and their subclasses may have no second base: so plugins are
    written as plain classes, and become Mitsuba's when they are registered.

    >>> class Greeting:
    ...     def greet(self) -> str:
    ...         return f"{type(self).__name__} {self:04}"
    >>> plugin_class(Greeting, int)(7).greet()
    'Greeting 0007'
    """
    own = {name: value for name, value in vars(methods).items() if name not in ("__dict__", "__weakref__")}
    return type(methods.__name__, (base,), own)
