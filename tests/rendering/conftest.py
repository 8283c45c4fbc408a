"""A renderer that is switched on."""

import pytest

from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate


@pytest.fixture(scope="session", autouse=True)
def backend():
    """The LLVM backend."""
    activated = activate("llvm")
    plugins.register()
    return activated
