"""The plan of a scene from a file: which file it is, how it is read, and what of it is there."""

from typing import Literal

from dataset_builder.spec.model import Model

PartName = Literal["floor", "walls", "ceiling"]
"""Parts of a building, which the light of a pass may have out of its way."""
SceneKind = Literal["procedural", "file", "usd", "front3d"]
"""`procedural`: a room made in code; `file`: a mesh file; `usd`: a USD stage; `front3d`: a scene of 3D-FRONT."""


class VariantChoice(Model):
    """One variant of a prim of a USD stage."""

    prim: str
    """Path of the prim."""
    set: str
    """Name of the variant set."""
    variant: str
    """Name of the variant."""


class PartPatterns(Model):
    """Which things of a scene belong to a part of the building, where the spec says so."""

    part: Literal["floor", "walls", "ceiling", "object"]
    """The part; `object` for what is none."""
    patterns: tuple[str, ...]
    """Names of things, with * and ?."""


class SceneSource(Model):
    """A scene file and how it is read: enough to read it again. Paths are as the spec gives them, relative to the
    folder of the dataset file."""

    source: str = ""
    """Path of the file; empty for no file."""
    source_sha256: str = ""
    """Digest over the file and every file that it names."""
    licence: str = ""
    """SPDX identifier of all that names none of its own."""
    scale: float = 1.0
    """Factor from file units to metres, above 0; times the metres that a file states."""
    up: Literal["x", "y", "z"] = "y"
    """Axis of a mesh file that points up; other kinds state theirs."""
    roots: tuple[str, ...] = ()
    """Folders, beside its own, that the scene may name files in."""
    variants: tuple[VariantChoice, ...] = ()
    """Of a USD stage, where the spec chooses them."""
    models: str = ""
    """Folder of the 3D-FUTURE models of a 3D-FRONT scene."""
    textures: str = ""
    """Folder of the textures of a 3D-FRONT scene."""
    parts: tuple[PartPatterns, ...] = ()
    """What belongs to which part of the building, where the spec says so."""


class SceneThingPlan(Model):
    """A thing of a scene file that is there."""

    instance: int
    """Value in the `instance` layer."""
    name: str
    """Its path or name in the file."""
    category: str
    """What it is, in a word; empty where nothing says so."""
    licence: str
    """SPDX identifier."""


class SceneFilePlan(Model):
    """What of a scene file is there."""

    file: SceneSource = SceneSource()
    """The file."""
    hidden: tuple[str, ...] = ()
    """Names of things that are taken away: what the spec leaves out, and the thing that is the target itself or that
    the target takes the place of."""
    things: tuple[SceneThingPlan, ...] = ()
    """Everything else; of the building, instance 2, only what is not under the licence of the file."""
