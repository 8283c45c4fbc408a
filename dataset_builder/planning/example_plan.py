"""The plan of one example: only numbers and names, every draw made. It is written beside the pixels as their label.

All lengths are metres, angles degrees, colours linear Rec.709, geometry Z up and right-handed. Keys and types never
vary between examples (readers freeze them from the first few), there are no nulls, and 64-bit seeds are strings.
"""

from typing import Literal

from pydantic import Field

from dataset_builder.spec.model import Model

Vector = tuple[float, float, float]


class Param(Model):
    """One drawn parameter of a family of objects."""

    name: str
    value: float


class ObjectPlan(Model):
    """What an object is, wherever it stands: enough to make its asset again."""

    name: str
    """Unique over the dataset: `train-chair-03`."""
    kind: Literal["procedural", "file"]
    source: str
    """Family name, or path of the mesh file as the spec gives it."""
    source_sha256: str
    """Digest over the mesh file and every file that it names (buffers, material libraries, textures); empty for a
    family."""
    category: str
    licence: str
    seed: str
    """Decimal 64-bit seed of materials and textures."""
    params: tuple[Param, ...]
    scale: float
    """Factor from file units to metres; 1 for a family."""
    up: Literal["x", "y", "z"]
    """Axis of a mesh file that points up."""


class PlacedObject(Model):
    """An object standing in the room: turned by `yaw` degrees about +Z, then moved to `position` (its base point)."""

    object: ObjectPlan
    instance: int
    """Value in the `instance` layer: 1 is the target, 2 the room, 3.. furniture."""
    position: Vector
    yaw: float


class RoomPlan(Model):
    """A room: x in [-width/2, width/2], y in [-depth/2, depth/2], z in [0, height]; materials follow from the seed."""

    name: str
    seed: str
    width: float
    depth: float
    height: float
    ceiling: bool
    windows: int
    """Windows are cut into the +Y wall first, then -X, +X, -Y; 0 to 4."""
    skirting: float
    """Height of the skirting board; 0 is none."""


class CameraPlan(Model):
    """Pinhole camera; `fov` is horizontal, in degrees. coverage and visibility are planning's estimates on 3DM."""

    position: Vector
    target: Vector
    up: Vector
    fov: float
    coverage: float
    """Share of the frame that the target object covers."""
    visibility: float
    """Share of the object's own silhouette that nothing hides and the frame does not cut."""


class LightPlan(Model):
    """One emitter. Unused fields are 0; `radiance` holds the emitter's natural unit, per channel.

    dome: radiance from everywhere. sun: irradiance on a surface facing it, travelling along `direction`.
    area: a square of side `size` whose normal is `direction`, radiance. sphere: radius `size`, radiance.
    point: radiant intensity. spot: radiant intensity on its axis `direction`, `cutoff` degrees to its edge.
    """

    kind: Literal["dome", "sun", "area", "sphere", "point", "spot"]
    position: Vector
    direction: Vector
    size: float
    cutoff: float
    radiance: Vector
    temperature: float
    """Colour temperature in kelvin that the colour was drawn from; 0 where it was not."""
    weight: float = Field(ge=0)
    """Unoccluded irradiance (mean of channels) at the target object, which light sampling is proportional to."""


class IlluminationPlan(Model):
    """All light of one pass, and what is taken out of its way."""

    lights: tuple[LightPlan, ...]
    open: tuple[str, ...]
    """Room parts left out of this pass: `ceiling`, `walls`."""


class RoughPlan(Model):
    """How the R3DM is made from the 3DM. sigma is in units of the object's bounding-sphere radius."""

    edge_length: float
    rounds: int
    crease_angle: float
    sigma: float
    level: int
    """Index of the noise level in the spec."""
    direction: Literal["isotropic", "normal"]
    seed: str


class RenderPlan(Model):
    """How pixels are computed. One spp per pass; `layers` says which layers on which pixels."""

    width: int
    height: int
    layers: tuple[tuple[str, Literal["object", "frame"]], ...]
    spp_first_hit: int
    spp_source: int
    spp_target: int
    spp_rough: int
    batches: int
    """Independent batches per pixel, from whose spread the standard error comes."""
    max_depth: int
    """Longest path in edges, Mitsuba's convention: 2 is direct light only."""
    rr_depth: int
    seed: str


class ExamplePlan(Model):
    """One view of one target object in one scene, under one light change, at one noise level."""

    schema_version: str
    key: str
    """Eight digits, unique over all splits."""
    index: int
    split: str
    view: str
    """Examples with the same view share camera, scene and every light-free layer: `train/000003`."""
    light: int
    """Index of the target light among those of the view."""
    room: RoomPlan
    target: PlacedObject
    furniture: tuple[PlacedObject, ...]
    camera: CameraPlan
    source_light: IlluminationPlan
    target_light: IlluminationPlan
    rough: RoughPlan
    render: RenderPlan
    notes: tuple[str, ...]
    """Why planning decided as it did, one sentence each."""
