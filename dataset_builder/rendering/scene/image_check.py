"""What is wrong with the images that a dataset's lights and rooms show, before anything is rendered."""

from dataclasses import replace

from dataset_builder.assets.image_maps import ImageFile, read_texels
from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.spec.image_uses import ENVIRONMENT_SUFFIXES, SURFACE_SUFFIXES, ImageUse
from dataset_builder.spec.resolve import LoadedSpec

SHAPES = (1.5, 3.0)
"""Widths over heights of what may be latitude and longitude, which are 2 to 1."""
COVERED = 1 - 1e-6
"""Share of an image of a wall that must be there: light does not pass what bounds a room."""


def check_images(loaded: LoadedSpec) -> None:
    """Read every image of a spec. Raises PlanError with all that is wrong, each with the line that names the image."""
    if problems := [problem for use in loaded.image_uses for problem in _problems(use, loaded)]:
        raise PlanError(problems)


def _problems(use: ImageUse, loaded: LoadedSpec) -> list[Problem]:
    if use.suffixes == SURFACE_SUFFIXES:
        return _surface_problems(use, loaded)
    # It loads the renderer's library, which specs without images do not wait for
    from dataset_builder.rendering.scene.images import read_image

    try:
        image = read_image(loaded.path.parent / use.name, loaded.images[use.name], use.suffixes)
    except PlanError as error:
        return [replace(problem, where=use.where, path=use.key, rule=f"{use.name}: {problem.rule}")
                for problem in error.problems]
    height, width, _ = image.shape
    if use.suffixes == ENVIRONMENT_SUFFIXES and not SHAPES[0] <= width / height <= SHAPES[1]:
        return [Problem(where=use.where, path=use.key, hint="convert mirror balls, fisheyes and cubes to it",
                        rule=f"{use.name}: expected latitude and longitude, twice as wide as high, got {width} x "
                        f"{height} pixels")]
    return []


def _surface_problems(use: ImageUse, loaded: LoadedSpec) -> list[Problem]:
    path = loaded.path.parent / use.name
    try:
        covered = float(read_texels(ImageFile(name=path.name, content=path), srgb=True, max_size=1)[..., 3].mean())
    except UserError as error:
        return [replace(problem, where=use.where, path=use.key, rule=f"{use.name}: {problem.rule}")
                for problem in error.problems]
    if covered < COVERED:
        return [Problem(where=use.where, path=use.key, hint="save it without an alpha channel",
                        rule=f"{use.name}: expected an image that is opaque, got one that covers {covered:.1%}")]
    return []
