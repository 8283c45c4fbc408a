"""The extras of this package, and which of them brings a library that is not installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from dataset_builder.errors import UserError

LIBRARIES = {
    "gltf": ("DracoPy", "meshopt", "opengl_basisu"),
    "build": ("mitsuba", "drjit", "scipy", "open3d", "mapbox_earcut", "ruamel", "rich", "matplotlib", "psutil",
              "skimage", "jinja2"),
    "look": ("pyvista", "vtkmodules"),
    "train": ("torch", "tensorboard", "skimage", "ruamel", "rich"),
    "denoise": ("pyoidn",),
    "usd": ("pxr",),
    "study": ("flip_evaluator",),
    "remote": ("fsspec", "aiohttp"),
    "s3": ("s3fs",),
    "gs": ("gcsfs",),
    "hf": ("huggingface_hub",),
    "ray": ("ray",),
}
"""What each extra brings, by the name that it is imported under."""


@contextmanager
def missing_named() -> Iterator[None]:
    """Raise UserError with what to install where a library that an extra brings is not there."""
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        extras = [extra for extra, names in LIBRARIES.items() if library in names]
        if not extras:
            raise
        commands = " or ".join(f'pip install "3df-lighting-builder[{extra}]"' for extra in extras)
        raise UserError(f"expected the package {library}, which is not installed; {commands}") from error
