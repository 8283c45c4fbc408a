"""A dataset as written: one YAML file with splits, cameras, light, noise levels, layers and accuracy."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, SerializerFunctionWrapHandler, Tag, model_serializer, model_validator

from dataset_builder.layers import ALIKE, HALF, LAYERS, PAPER_LAYERS
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.field import FieldSpec, SeenSpec, require_seen
from dataset_builder.spec.file_scene import ThingQuery
from dataset_builder.spec.layer_extents import LayerExtents
from dataset_builder.spec.licences import Licence
from dataset_builder.spec.light import LightCount, SourceSpec, TargetSpec
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import MOST_EXAMPLES, Count, Interval, Share, branches, interval
from dataset_builder.spec.render import ImageSpec, RenderSpec, require_spread
from dataset_builder.spec.rough import Level, RoughSpec

Shareable = Literal["objects", "scenes"]
"""What two splits may have in common, where one says so."""


class ObjectsSpec(Model):
    """Object files that a split draws from, or the things of its scenes, and the number of different objects."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["from"]}, {"required": ["things"]}]})

    source: Annotated[tuple[str, ...], Field(alias="from")] = ()
    """Object files, relative to the dataset file; used in rotation."""
    things: ThingQuery | None = None
    """Things of the scenes themselves, each where it stands, in place of object files."""
    count: Count
    """Number of different objects; a file with distributions gives a new object each time it is used. Of things: how
    many of each scene."""

    @model_validator(mode="after")
    def _one_kind(self) -> "ObjectsSpec":
        if bool(self.source) == (self.things is not None):
            got = "both" if self.source else "neither"
            raise broken(f"expected exactly one of `from` and `things`, got {got}")
        return self


class ScenesSpec(Model):
    """Scene files that a split draws from, and the number of different scenes."""

    source: Annotated[tuple[str, ...], Field(min_length=1, alias="from")]
    """Scene files, relative to the dataset file; used in rotation."""
    count: Count
    """Number of different scenes."""


def _all_or_count(value: Any) -> str | None:
    if isinstance(value, str):
        return "|all" if value == "all" else None
    return "|count" if isinstance(value, int) and not isinstance(value, bool) else None


Pairs = Annotated[
    Annotated[Count, Tag("|count")] | Annotated[Literal["all"], Tag("|all")],
    branches(_all_or_count, "expected a whole number or all"),
]


class SplitSpec(Model):
    """One split: its own objects and scenes, disjoint from every other split's unless it says otherwise."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9]*$", max_length=50)]
    """Part of the names of shards; lower-case letters and digits."""
    objects: ObjectsSpec
    """Target objects."""
    scenes: ScenesSpec
    """Rooms with furniture."""
    pairs: Pairs = "all"
    """Number of (object, scene) pairs; `all` uses every combination."""
    views: Count = 1
    """Cameras per pair."""
    lights: LightCount = 1
    """Target lights per view, or per pair. each: one for each lamp of `target.lights` that is on, that lamp alone, as
    it is among all of them, without light from outside."""
    lights_per: Literal["view", "pair"] = "view"
    """What has source and target lights of its own. view: each view. pair: all views of a pair are lit the same, by
    lights that are in no view's way and are judged by what all of them see."""
    camera: CameraSpec | None = None
    """Viewpoints of this split, in place of the dataset's `camera` as a whole."""
    source: SeenSpec = SeenSpec()
    """What `i_s` shows, and where rough meshes come from: the clean mesh, or a neural field of each object."""
    allow_shared: tuple[Shareable, ...] = ()
    """What this split may have in common with others: `objects`, `scenes` or both; none unless given."""

    @model_serializer(mode="wrap")
    def _without_nothing(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in plain(self).items() if value or key != "allow_shared"}

    def levels(self, rough: RoughSpec) -> tuple[Level, ...]:
        """What rough meshes are made by, one example each: the dataset's levels, or the split's own field."""
        return (self.source,) if self.source.mesh else rough.levels

    @model_validator(mode="after")
    def _enough_pairs(self) -> "SplitSpec":
        most = self.objects.count * self.scenes.count
        if self.pairs != "all" and self.pairs > most:
            rule = f"expected <= {self.objects.count} objects x {self.scenes.count} scenes = {most}, got {self.pairs}"
            raise broken(rule, path=("pairs",))
        return self


class StorageSpec(Model):
    """How layers are stored."""

    dtype: Literal["float32", "float16"] = "float32"
    """Pixel type; with float16, examples with values beyond its range, or too dim for it, are rejected."""
    examples_per_shard: Annotated[int, Field(ge=1, le=5000)] = 16
    """Maximum number of consecutive examples per tar file; fewer in a split that would have fewer than 4 files."""
    standard_errors: bool = False
    """Also store a standard-error layer for every radiometric layer."""
    shared: Literal["each", "once"] = "each"
    """Files with equal pixels of examples of one view. each: every example has all of its files. once: a shard has
    them once, for readers that go by its index."""


class GatesSpec(Model):
    """Bounds that an example must meet to be included in the dataset."""

    mask_overlap: Share = 0.7
    """Minimum intersection over union of `mask` and `mask_rough`, and minimum share of `mask` that `mask_field` covers
    where `i_s` is the image of a field."""
    s_prime_energy: Annotated[Interval, interval(0)] = (1e-3, 1e3)
    """Minimum and maximum mean of `s_prime` over the mask."""
    coverage: Annotated[Interval, interval(0, 1)] = (0.01, 0.95)
    """Minimum and maximum share of the frame under the mask."""
    mean_error: Annotated[float, Field(ge=0)] = 0.0
    """Maximum `mean_error` of every layer with light, whose mean must not be unknown either; 0: no bound."""
    tail: Annotated[float, Field(ge=0)] = 0.0
    """Maximum `tail` of every layer with light; 0: no bound."""


class DatasetSpec(Model):
    """One dataset."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$", max_length=100)]
    """Name of the folder and of the shards; lower-case letters, digits and hyphens."""
    version: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$", max_length=30)] = "1.0.0"
    """Three numbers; the first is part of the names of shards."""
    title: Annotated[str, Field(pattern=r"^[^\n]*$", max_length=200)] = ""
    """Human-readable title; if empty, the name is used."""
    description: str = ""
    """One or two sentences for the card."""
    licence: Licence = ""
    """SPDX identifier of the dataset; if empty, it follows from those of the objects. It must keep what theirs ask."""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    """Seed of all random draws; 0 is a valid seed."""
    image: ImageSpec = ImageSpec()
    """Size of every layer."""
    layers: LayerExtents = dict.fromkeys(PAPER_LAYERS, "object")
    """Layers by name, each with its extent (`object` or `frame`); in a list, names alone have `object`."""
    render: RenderSpec = RenderSpec()
    """Samples and path lengths."""
    rough: RoughSpec = RoughSpec()
    """How rough meshes are made."""
    camera: CameraSpec = CameraSpec()
    """Viewpoints of splits that have none of their own."""
    source: SourceSpec = SourceSpec()
    """Source light."""
    target: TargetSpec = TargetSpec()
    """Target light."""
    gates: GatesSpec = GatesSpec()
    """Bounds that an example must meet to be included."""
    storage: StorageSpec = StorageSpec()
    """Files."""
    splits: Annotated[tuple[SplitSpec, ...], Field(min_length=1)]
    """One or more, with different names."""

    def split_of(self, name: str) -> SplitSpec:
        """The split of that name."""
        return next(split for split in self.splits if split.name == name)

    def camera_of(self, split: str) -> CameraSpec:
        """Viewpoints of the split of that name."""
        return self.split_of(split).camera or self.camera

    @model_validator(mode="after")
    def _lamps_take_turns(self) -> "DatasetSpec":
        for index, split in enumerate(self.splits):
            if split.lights == "each" and not self.target.lamps:
                raise broken("expected a list of lamps in `target.lights`, each to shine alone, got random lights",
                             path=("splits", index, "lights"))
        return self

    @model_validator(mode="after")
    def _few_enough_examples(self) -> "DatasetSpec":
        counts = [len(split.levels(self.rough)) * self.target.count_of(split.lights) * split.views * (
            split.objects.count * split.scenes.count if split.pairs == "all" else split.pairs)
            for split in self.splits]
        if (total := sum(counts)) > MOST_EXAMPLES:
            raise broken(f"expected at most {MOST_EXAMPLES} examples of all splits together, got {total}",
                         path=("splits",))
        return self

    @model_validator(mode="after")
    def _albedo_has_a_spread(self) -> "DatasetSpec":
        require_spread(self.render.spp, self.layers)
        return self

    @model_validator(mode="after")
    def _layers_are_there(self) -> "DatasetSpec":
        for key, names in (("accuracy", tuple(self.render.accuracy)), ("denoise", self.render.denoise.layers)):
            for name in names:
                if name not in self.layers:
                    path = ("render", key, name) if key == "accuracy" else ("render", key, "layers")
                    raise broken(f"expected layers that the dataset holds, got {name}", path=path,
                                 known=tuple(self.layers))
        return self

    @model_validator(mode="after")
    def _halves_are_independent(self) -> "DatasetSpec":
        wrong = "i_t denoised" if "i_t" in self.render.denoise.layers else f"{self.render.batches} batches"
        if HALF in self.layers and (self.render.batches % 2 or wrong.startswith("i_t")):
            raise broken(f"expected an even number of batches and i_t as it was sampled, got {wrong}",
                         path=("layers", HALF))
        return self

    @property
    def fields(self) -> bool:
        """Whether any example needs a field that is to be made."""
        return any(split.source.image or any(isinstance(level, FieldSpec) for level in split.levels(self.rough))
                   for split in self.splits)

    @model_validator(mode="after")
    def _fields_are_seen_alone(self) -> "DatasetSpec":
        require_seen({split.name: split.source for split in self.splits}, self.layers, self.render.denoise.layers)
        return self

    @model_validator(mode="after")
    def _differences_are_smooth(self) -> "DatasetSpec":
        alike = [name for name in self.layers if LAYERS[name].render_pass in ALIKE and not LAYERS[name].of]
        goals = [name for name in self.render.accuracy if name in alike]
        if goals and len({LAYERS[name].render_pass for name in alike}) > 1:
            others = ", ".join(name for name in alike if LAYERS[name].render_pass != LAYERS[goals[0]].render_pass)
            raise broken(f"expected a fixed spp, since {goals[0]} shares its random numbers with {others}, got a goal "
                         "(set render.spp.target instead)", path=("render", "accuracy", goals[0]))
        return self

    @model_validator(mode="after")
    def _distinct_splits(self) -> "DatasetSpec":
        names = [split.name for split in self.splits]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise broken(f"expected split names to differ, got {name} again", path=("splits", index, "name"))
        return self
