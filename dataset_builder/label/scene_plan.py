"""The plan of what stands where: objects, the room, the camera, the air between them, and the light of one pass."""

from typing import Literal

from pydantic import Field

from dataset_builder.label.scene_source import SceneFilePlan, SceneKind, SceneSource
from dataset_builder.light_kinds import LightName
from dataset_builder.spec.mesh_source import names_field
from dataset_builder.spec.model import Model

Vector = tuple[float, float, float]


class Param(Model):
    """One drawn parameter of a family of objects."""

    name: str
    """Of the parameter, as `dataset-builder families` lists it; of a field where materials are changed."""
    value: float
    """In the parameter's own unit: metres, degrees, a share or a count."""


class MaterialChange(Model):
    """Drawn changes to the materials of one name."""

    name: str
    """Material that is changed, `*` for all."""
    values: tuple[Param, ...]
    """Pairs of a field of `assets.asset.Material` and its value. Colours are three fields, `base_color.0` to `.2`;
    truth is 0 or 1; `plain` 1 leaves the texture out."""


class RoomMaterialPlan(MaterialChange):
    """What a part of a procedural room is finished with; `values` change it. Its name is `wall`, `floor`, `ceiling` or
    `trim`."""

    family: str = ""
    """Finish made in code in place of the drawn one; empty for none."""
    tone: str = ""
    """Which of the family's; empty where the room's seed draws it."""
    image: str = ""
    """Texture, relative to the folder of the dataset file; empty for none."""
    image_sha256: str = ""
    """SHA-256 of its file; empty for none."""
    size: float = 0.0
    """Metres that one repeat of it covers; 0 for none."""


class ObjectPlan(Model):
    """What an object is, wherever it stands: enough to make its asset again."""

    name: str
    """Unique over the dataset: `train-chair-03`."""
    kind: Literal["procedural", "file", "thing"]
    """`procedural`: of an embedded family; `file`: a mesh file; `thing`: one of the things of a scene file."""
    source: str
    """Family name, or path of the mesh or scene file as the spec gives it."""
    source_sha256: str
    """Digest over the mesh file and every file that it names (buffers, material libraries, textures), or over what a
    thing is made of; empty for a family."""
    category: str
    """What it is, in a word: `chair`."""
    licence: str
    """SPDX identifier of the object's licence."""
    seed: str
    """Decimal 64-bit seed of materials and textures."""
    params: tuple[Param, ...]
    """What was drawn of the family's parameters; empty for a file."""
    materials: tuple[MaterialChange, ...] = ()
    """What was changed about materials, in the order of the spec."""
    scale: float
    """Factor from file units to metres, above 0; 1 for a family."""
    up: Literal["x", "y", "z"]
    """Axis of a mesh file that points up; `z` for a family and a thing."""
    scene: SceneSource = SceneSource()
    """The scene file of a thing; empty for all else."""
    thing: str = ""
    """Name of a thing in its scene; empty for all else."""
    linear: tuple[float, float, float, float, float, float, float, float, float] = (
        1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    """(3, 3) by rows: what a thing's mesh is multiplied by to come to the object's frame; it scales, tilts and mirrors,
    and leaves the turn about +Z to `yaw`. 1 for all else."""


class ObjectSource(Model):
    """What some objects of a dataset were made from, and who may do what with it."""

    kind: Literal["procedural", "file", "thing"]
    """As of the objects; `thing` for all things of a scene file."""
    source: str
    """Family name, or path of the mesh or scene file as the spec gives it."""
    licence: str
    """SPDX identifier."""
    objects: tuple[str, ...]
    """Names of those objects, targets before furniture."""

    @property
    def captured(self) -> bool:
        """Whether it is the field of a capture."""
        return self.kind != "procedural" and names_field(self.source)


class PlacedObject(Model):
    """An object standing in the room: turned by `yaw` about +Z, then moved to `position`."""

    object: ObjectPlan
    """What stands there."""
    instance: int
    """Value in the `instance` layer: 1 is the target, 2 the room, 3.. furniture."""
    position: Vector
    """Where its base point stands, metres; z is 0 on the floor."""
    yaw: float
    """Degrees that it is turned about +Z, counter-clockwise from above."""


class RoomPlan(Model):
    """What is around. A procedural room: x in [-width/2, width/2], y in [-depth/2, depth/2], z in [0, height];
    materials follow from the seed. A scene from a file lies where the file has it; width, depth and height are its own.
    """

    name: str
    """Unique over the dataset."""
    seed: str
    """Decimal 64-bit seed of materials and textures."""
    width: float
    """Along x, metres."""
    depth: float
    """Along y, metres."""
    height: float
    """Along z, metres."""
    ceiling: bool
    """Whether it has one."""
    glazing: bool = False
    """Whether windows have panes of thin glass."""
    windows: int
    """Windows are cut into the +Y wall first, then -X, +X, -Y; 0 to 4."""
    skirting: float
    """Height of the skirting board, metres; 0 is none."""
    materials: tuple[RoomMaterialPlan, ...] = ()
    """What its parts are finished with that the spec does not leave to the seed."""
    kind: SceneKind = "procedural"
    """Where it comes from."""
    scene: SceneFilePlan = SceneFilePlan()
    """The scene file, and what of it is there; empty for a procedural room."""


class CameraPlan(Model):
    """A pinhole camera; `geometry.pinhole.Pinhole` has its matrices."""

    position: Vector
    """Centre of projection, metres."""
    target: Vector
    """Point that is seen in the middle of the frame, metres."""
    up: Vector
    """Unit vector whose projection points up in the frame."""
    fov: float
    """Horizontal field of view, degrees, between 0 and 180."""
    coverage: float
    """Share of the frame that the target object covers, 0 to 1: planning's estimate on the 3DM."""
    visibility: float
    """Share of the object's own silhouette that nothing hides and the frame does not cut, 0 to 1: planning's estimate
    on the 3DM."""


class FogPlan(Model):
    """A homogeneous medium that fills the scene."""

    extinction: float = 0.0
    """Per metre, 0 or more; 0 is clear air."""
    albedo: float = 0.0
    """Share of the extinction that is scattered, 0 to 1."""
    anisotropy: float = 0.0
    """Mean cosine of the scattering angle (Henyey and Greenstein), -1 to 1."""


class LightPlan(Model):
    """One emitter. Unused fields are 0; `radiance` holds the emitter's natural unit, per channel.

    dome: radiance from everywhere. sun: irradiance on a surface facing it, travelling along `direction`.
    area: a rectangle of sides `size` and `length` whose normal is `direction`, a square where `length` is 0, radiance.
    sphere: radius `size`, radiance. disk: radius `size`, normal `direction`, radiance.
    cylinder: radius `size`, `length` along its axis `direction`, open at both ends, radiance.
    point: radiant intensity. spot: radiant intensity on its axis `direction`, the same up to `beam` degrees from it and
    then falling linearly to `cutoff` degrees, its edge.
    A rectangle's first side is square to +Z, or to +X where `direction` is within 26 degrees of the vertical; then it
    is turned by `turn`. Seen from where it shines, with the first side to the right and the second upwards, an image
    on it stands upright; on a square its upper and lower edge are exchanged.
    """

    kind: LightName
    """What emits; see above for what the other keys mean by kind."""
    name: str = ""
    """As the spec or the scene file has it; empty for lights that are drawn and for lamps without a name."""
    position: Vector
    """Of its middle, metres."""
    direction: Vector
    """Unit vector that the light leaves along."""
    size: float
    """Side of a square or first side of a rectangle, radius of a ball, a disk or a cylinder, metres."""
    cutoff: float
    """Degrees from the axis of a spot to its edge."""
    beam: float = 0.0
    """Degrees from the axis of a spot to where it begins to fall off; 0 for three quarters of `cutoff`."""
    radiance: Vector
    """Red, green, blue, linear Rec.709, 0 or more: W/(m^2 sr) of a dome, area, sphere, disk or cylinder, W/m^2 of a
    sun, W/sr of a point or spot. Lights of a scene file have its own units, times one factor for all."""
    temperature: float
    """Colour temperature in kelvin that the colour was drawn from; 0 where it was not."""
    image: str = ""
    """Image that multiplies the radiance, as the spec gives it: latitude-longitude of a dome, texture of an area light,
    brought to mean 1; empty for none."""
    image_sha256: str = ""
    """SHA-256 of the image's file; empty for none."""
    turn: float = 0.0
    """Degrees that a dome's image is turned about +Z, or a rectangle about its direction."""
    length: float = 0.0
    """Second side of an area light that is no square, length of a cylinder, metres; 0 for all else."""
    weight: float = Field(ge=0)
    """Irradiance (mean of channels) at the target object, W/m^2, which light sampling is proportional to: unoccluded
    for lamps and for the source, what gets in for target lights outside. Images count as their mean."""


class PortalPlan(Model):
    """A rectangle that light from outside gets in through, as large as the opening or larger. Its inward normal is
    `right` x `up`: seen from inside, `right` points right and `up` up."""

    corner: Vector
    """One of its corners, metres."""
    right: Vector
    """Along its first side, as long as that, metres."""
    up: Vector
    """Along its second side, square to `right`, as long as that, metres."""


class IlluminationPlan(Model):
    """All light of one pass, and what is taken out of its way."""

    lights: tuple[LightPlan, ...]
    """Every emitter; passes name them by their place here, from 0."""
    open: tuple[str, ...]
    """Room parts left out of this pass: `ceiling`, `walls`."""
