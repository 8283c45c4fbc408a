"""The plan of one example: only numbers and names, every draw made. It is written beside the pixels in their label.

All lengths are metres, angles degrees, colours linear Rec.709, geometry Z up and right-handed. Keys and types never
vary between examples (readers freeze them from the first few), there are no nulls, and 64-bit seeds are strings.
"""

from typing import Literal

from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import (
    CameraPlan,
    FogPlan,
    IlluminationPlan,
    Param,
    PlacedObject,
    PortalPlan,
    RoomPlan,
)
from dataset_builder.label.sequence_plan import SequencePlan
from dataset_builder.layers import Extent, Pass, sampled_as
from dataset_builder.spec.model import Model


class Decision(Model):
    """One thing that is simulated or not, and why."""

    effect: str
    """What was decided on."""
    choice: str
    """What was chosen, in a word or figure."""
    reason: str
    """Why, in one sentence."""


Feature = Literal["textures", "maps", "colours", "specular", "coat", "sheen", "glass", "thin", "dispersion", "nested",
                  "coverage", "emission", "fog"]
"""What a kernel can do beyond Lambertian surfaces in clear air: the rendering kernels are compiled with those that the
scene calls for."""


Transport = Literal["camera", "joined"]
"""How a pass finds light that has bounced: by paths from the camera alone, or joined with paths from the lamps."""


class PassEffects(Model):
    """What one pass simulates."""

    name: Pass
    """Of the pass."""
    extent: Extent
    """Pixels that it is traced on."""
    lights: tuple[int, ...]
    """Which of its illumination's lights, by their place there."""
    max_depth: int
    """Longest path in edges; 2 is direct light."""
    transport: Transport = "camera"
    """By which paths it finds light; passes without light have no use for it."""
    caustics: bool = False
    """Whether many light paths are sent, for what large smooth glass, metal and coats throw on other surfaces."""
    portals: tuple[PortalPlan, ...] = ()
    """Openings that samples of its dome go through; none where they go all round."""


class EffectsPlan(Model):
    """Which effects an example's passes simulate, decided from its plan and its materials; see `planning.effects`."""

    features: tuple[Feature, ...]
    """What the scene calls for beyond Lambertian surfaces in clear air."""
    passes: tuple[PassEffects, ...]
    """One of every pass, needed or not."""
    decisions: tuple[Decision, ...]
    """Every choice with its reason."""

    def of(self, name: str) -> PassEffects:
        """What the pass `name` simulates."""
        return next(entry for entry in self.passes if entry.name == name)


class RoughStep(Model):
    """One step on the way to the R3DM, with its numbers drawn."""

    kind: Literal["white", "field", "scanlines", "bumps", "smooth", "decimate", "voxels", "thin", "close_holes"]
    """What is done, see docs/rough-meshes.md."""
    along: Literal["isotropic", "normal"]
    """Whether vertices move any way or along their normals; `isotropic` for steps that have no such choice."""
    values: tuple[Param, ...]
    """The step's numbers by the names of its keys in the spec; lengths in radii of the object's bounding sphere."""

    def __getitem__(self, name: str) -> float:
        """The number called `name`."""
        return next(param.value for param in self.values if param.name == name)


class RoughPlan(Model):
    """How the R3DM is made from the 3DM."""

    edge_length: float
    """What edges are to be as long as, metres; before subdivision they are split to `edge_length` * 2^`rounds`."""
    rounds: int
    """Rounds of subdivision, 0 or more."""
    crease_angle: float
    """Degrees between faces above which an edge stays sharp."""
    sigma: float
    """Standard deviation of the noise of vertices, in radii of the object's bounding sphere, 0 or more; with `steps`,
    that of their noise together, bumps left out."""
    level: int
    """Index of the noise level in the spec, from 0."""
    direction: Literal["isotropic", "normal"]
    """Whether vertices move any way or along their normals; steps have their own."""
    seed: str
    """Decimal 64-bit seed of the noise."""
    name: str = ""
    """Of the noise level, where the spec names one."""
    steps: tuple[RoughStep, ...] = ()
    """What makes it rough, in order; none for vertex noise of `sigma` alone."""
    coarsen: bool = False
    """Whether a mesh that is finer than `edge_length` is decimated to it beforehand."""
    triangles: int = 4_000_000
    """Maximum number of triangles."""
    above_support: bool = False
    """Whether noise that would sink the object into what it stands on is mirrored up: where much of its upper side lies
    close above that."""
    field: FieldPlan = FieldPlan()
    """The field that the R3DM is taken from, in place of all above but `level` and `name`."""


class GoalPlan(Model):
    """How good a layer is to be; sampling ends with what is reached first."""

    layer: str
    """Layer that it is about."""
    error: float
    """Relative error, root mean square; 0 where not asked for."""
    seconds: float
    """Time; 0 where not asked for."""
    cap: int
    """Most spp of any pixel."""


class SppPart(Model):
    """One part of a pass's spp, sampled after the parts before it."""

    render_pass: str
    """Name of the pass."""
    spp: int
    """Samples per pixel."""


class RenderPlan(Model):
    """How pixels are computed. One spp per pass; `layers` says which layers on which pixels."""

    width: int
    """Of every layer, pixels."""
    height: int
    """Of every layer, pixels."""
    layers: tuple[tuple[str, Extent], ...]
    """Pairs of a layer's name and its extent."""
    spp_first_hit: int
    """Samples per pixel of the passes that see surfaces alone."""
    spp_source: int
    """Samples per pixel under the source light."""
    spp_target: int
    """Samples per pixel under the target light."""
    spp_rough: int
    """Samples per pixel of the rough mesh."""
    spp_parts: tuple[SppPart, ...] = ()
    """Passes whose spp is taken in several parts, with the parts in order; none for passes that take it at once."""
    batches: int
    """Independent batches per pixel, from whose spread the standard error comes."""
    goals: tuple[GoalPlan, ...] = ()
    """By layer, several of one layer in the order that they are reached; passes of layers without one take a fixed
    spp."""
    rr_depth: int
    """Path length in edges from which Russian roulette may end a path."""
    texture_size: int = 4096
    """Most texels along a side of a texture."""
    texels_per_pixel: float = 0.0
    """How fine textures are where the camera is nearest to them, for a scene from a file; 0 is as they come."""
    denoise: tuple[str, ...] = ()
    """Layers that are denoised."""
    keep_raw: bool = False
    """Whether these are shipped as they were before, too, as `<layer>_raw`."""
    seed: str
    """Decimal 64-bit seed of all sampling."""

    def parts(self, render_pass: str) -> tuple[int, ...]:
        """The parts of a pass's spp, in order."""
        name = "first_hit" if render_pass.startswith("first_hit") else sampled_as(render_pass)
        several = tuple(part.spp for part in self.spp_parts if part.render_pass == name)
        return several or (getattr(self, f"spp_{name}"),)


class ExamplePlan(Model):
    """One view of one target object in one scene, under one light change, at one noise level."""

    schema_version: str
    """Of the plan's keys."""
    key: str
    """Eight digits, unique over all splits."""
    index: int
    """Place in the dataset over all splits, from 0; the key as a number."""
    split: str
    """Split that it belongs to."""
    view: str
    """Examples with the same view share camera, scene and every light-free layer: `train/000003`."""
    light: int
    """Index of the target light among those of the view, from 0."""
    room: RoomPlan
    """The room around it."""
    target: PlacedObject
    """The object that the example is of."""
    furniture: tuple[PlacedObject, ...]
    """What else stands in the room."""
    camera: CameraPlan
    """Where it is seen from."""
    sequence: SequencePlan = SequencePlan()
    """Its place among views that follow each other."""
    source_light: IlluminationPlan
    """The light of `i_s`."""
    target_light: IlluminationPlan
    """The light of `i_t`, `s` and `s_prime`."""
    rough: RoughPlan
    """How the rough mesh is made."""
    fog: FogPlan = FogPlan()
    """What fills the air."""
    field: FieldPlan = FieldPlan()
    """The field that `i_s` shows the object through; none where it is rendered from the 3DM."""
    render: RenderPlan
    """How pixels are computed."""
    effects: EffectsPlan
    """What is simulated, and why."""
    notes: tuple[str, ...]
    """Why planning decided as it did, one sentence each."""
