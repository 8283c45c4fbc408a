"""Small USD stages for tests of scenes, written as text."""

import pytest

from dataset_builder.assets.scene_file import load_scene
from dataset_builder.errors import UserError
from dataset_builder.label.scene_source import SceneSource, VariantChoice
from tests.assets.readers.usd_files import mesh, write

METRES = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'


def moved(ops):
    """Lines of xformOps, given as (type, name, value); the order is as given."""
    lines = [f"{kind} xformOp:{name} = {value}" for kind, name, value in ops if kind]
    order = ", ".join(f'"{name}"' if name.startswith("!") else f'"xformOp:{name}"' for _, name, _ in ops)
    return "\n".join([*lines, f"uniform token[] xformOpOrder = [{order}]"])


def at(x, y=0, z=0):
    """A translation."""
    return moved([("double3", "translate", f"({x}, {y}, {z})")])


def prim(kind, name, *inner, metadata=""):
    """A prim with what is in it."""
    return f'def {kind} "{name}" ({metadata}) {{\n' + "\n".join(inner) + "\n}\n"


def scene(folder, text, name="a.usda", **source):
    """The scene of a stage."""
    path = write(folder, text, name)
    return load_scene(SceneSource(source=path.name, licence="CC0-1.0", **source), folder)


def refused(folder, text, **source):
    """What is said of a stage that is not read."""
    with pytest.raises(UserError) as caught:
        scene(folder, text, **source)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def names(model):
    """Names of the things of a scene."""
    return [thing.name for thing in model.things]


def place(thing):
    """The middle of the box of a thing in the world, to a micrometre."""
    corners = thing.asset.mesh.positions @ thing.world[:3, :3].T + thing.world[:3, 3]
    return tuple((corners.min(axis=0) / 2 + corners.max(axis=0) / 2).round(6).tolist())


def choose(prim_path, name, variant):
    """A choice of a variant."""
    return VariantChoice(prim=prim_path, set=name, variant=variant)


__all__ = ["METRES", "at", "choose", "mesh", "moved", "names", "place", "prim", "refused", "scene"]
