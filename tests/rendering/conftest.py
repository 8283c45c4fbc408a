"""A renderer that is switched on."""

import pytest

from dataset_builder.rendering.backend import activate


@pytest.fixture(scope="session", autouse=True)
def backend():
    """The LLVM backend, chosen before Mitsuba is imported."""
    activated = activate("llvm")
    from dataset_builder.rendering import plugins

    plugins.register()
    return activated
