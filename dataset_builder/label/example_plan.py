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


class MaterialChange(Model):
    """Drawn changes to the materials called `name`, `*` for all: pairs of a field of `assets.asset.Material` and its
    value. Colours are three fields, `base_color.0` to `.2`; truth is 0 or 1; `plain` 1 leaves the texture out."""

    name: str
    values: tuple[Param, ...]


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
    materials: tuple[MaterialChange, ...] = ()
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
    glazing: bool = False
    """Whether windows have panes of thin glass."""
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
    image: str = ""
    """Image that multiplies the radiance, as the spec gives it: latitude-longitude of a dome, texture of an area light,
    brought to mean 1; empty for none."""
    image_sha256: str = ""
    turn: float = 0.0
    """Degrees that a dome's image is turned about +Z."""
    weight: float = Field(ge=0)
    """Irradiance (mean of channels) at the target object, which light sampling is proportional to: unoccluded for lamps
    and for the source, what gets in for target lights outside. Images count as their mean."""


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


class FogPlan(Model):
    """A homogeneous medium that fills the scene; extinction 0, per metre, is clear air."""

    extinction: float = 0.0
    albedo: float = 0.0
    anisotropy: float = 0.0


class GoalPlan(Model):
    """How good a layer is to be. error, seconds: 0 where not asked for. cap: most spp of any pixel."""

    layer: str
    error: float
    seconds: float
    cap: int


class Decision(Model):
    """One thing that is simulated or not, and why. effect: what; choice: in a word or figure; reason: one sentence."""

    effect: str
    choice: str
    reason: str


Feature = Literal["textures", "specular", "coat", "sheen", "glass", "thin", "dispersion", "fog"]
"""What a kernel can do beyond Lambertian surfaces in clear air: the rendering kernels are compiled with those that the
scene calls for."""


class PassEffects(Model):
    """What one pass simulates. lights: which of its illumination's lights, by index. max_depth: longest path in
    edges."""

    name: Literal["first_hit", "source", "target", "first_hit_rough", "rough"]
    extent: Literal["object", "frame"]
    lights: tuple[int, ...]
    max_depth: int


class EffectsPlan(Model):
    """Which effects an example's passes simulate, decided from its plan and its materials; see `planning.effects`."""

    features: tuple[Feature, ...]
    passes: tuple[PassEffects, ...]
    """One of every pass, needed or not."""
    decisions: tuple[Decision, ...]

    def of(self, name: str) -> PassEffects:
        """What the pass `name` simulates."""
        return next(entry for entry in self.passes if entry.name == name)


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
    goals: tuple[GoalPlan, ...] = ()
    """By layer; passes of layers without one take a fixed spp."""
    rr_depth: int
    texture_size: int = 4096
    """Most texels along a side of a texture."""
    denoise: tuple[str, ...] = ()
    """Layers that are denoised."""
    keep_raw: bool = False
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
    fog: FogPlan = FogPlan()
    render: RenderPlan
    effects: EffectsPlan
    notes: tuple[str, ...]
    """Why planning decided as it did, one sentence each."""
