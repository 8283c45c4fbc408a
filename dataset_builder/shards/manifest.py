"""The manifest, `dataset.json`: what a dataset holds; it does not contain the time of the build."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypeVar

from pydantic import Field, SerializerFunctionWrapHandler, ValidationError, model_serializer, model_validator

from dataset_builder.digest import canonical_json
from dataset_builder.errors import Problem, ShardError
from dataset_builder.label.example_label import Denoised
from dataset_builder.label.scene_plan import ObjectSource
from dataset_builder.label.shared_content import SharedContent
from dataset_builder.layers import LAYERS, Extent
from dataset_builder.shards import exr
from dataset_builder.shards.folder import FORMAT
from dataset_builder.shards.identities import identity_table
from dataset_builder.shards.shard_index import Count, ShardIndex, ShardRecord
from dataset_builder.shards.subset_record import SubsetRecord
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.layer_extents import LayerName
from dataset_builder.spec.model import Model
from dataset_builder.spec.problems import LONGEST_VALUE

MOST_PROBLEMS = 100
STORED_ONCE = ("Files with equal pixels of examples of one view are stored once per shard, under the key of the first "
               "example that has them. The index of the shard says for each example where its files are; readers that "
               "see only the tar find what an example does not share.")
M = TypeVar("M", bound=Model)
Gives = Literal["i_s", "r3dm"]
LAYOUT_DATE = "2026-11-23"
"""Day this layout was fixed: the `datePublished` of a dataset that gives none, since two builds must be equal bytes."""


class LayerRecord(Model):
    """One layer, as `layers.py` defines it, with this dataset's extent and storage type."""

    name: LayerName
    member: str
    symbol: str
    geometry: str
    extent: Extent
    channels: int
    dtype: exr.DType
    colour_space: str
    range: str
    unit: str
    meaning: str

    @model_validator(mode="after")
    def _has_its_channels(self) -> "LayerRecord":
        if self.channels != (channels := LAYERS[self.name].channels):
            raise ValueError(f"expected {channels} channels of {self.name}, got {self.channels}")
        return self


class IdentityRecord(Model):
    """A rule that every shipped example keeps, to the stated tolerance."""

    name: str
    rule: str
    tolerance: float


class FieldSummary(Model):
    """Fields of one kind that examples of a split are seen through, or take rough meshes from."""

    split: str
    kind: Literal["density", "sdf", "splats"]
    gives: tuple[Gives, ...]
    """Whether `i_s` is their image, and whether their meshes are the rough meshes."""
    captures: bool
    """Whether the objects are captures, which have no clean mesh."""
    fields: int
    """How many different ones."""
    views: int
    """Images that each was fitted to, at the least; 0 for splats, which were fitted elsewhere."""
    resolution: int
    """Cells along a side of their grids, at the least; 0 for splats."""
    psnr: float
    """Of held-out images, dB: mean over those that have some; 0 where none has."""
    psnr_worst: float
    """Of the worst image of all."""
    opacity_iou: float
    """Of held-out images and opacity, of the worst field; 0 where none has any."""


class SplitRecord(Model):
    """One split and its shards, in order."""

    name: str
    examples: Count
    shards: tuple[str, ...]


class Totals(Model):
    """Sums over all shards."""

    examples: Count
    shards: Count
    bytes: Count
    rejected: Count


class Rejected(Model):
    """An example that was planned and is not shipped: the gate that it failed and the figures."""

    key: str
    view: str
    gate: str
    reason: str


class Manifest(Model):
    """What `dataset.json` holds. It is written last: where it is, the dataset is whole."""

    format: Literal["3df-lighting"] = "3df-lighting"
    schema_version: Literal["1"] = "1"
    name: str
    version: str
    title: str
    description: str
    licence: str
    creator: str
    url: str
    date_published: str
    generator: str
    spec_digest: str
    width: int = Field(ge=1, le=exr.MAX_SIDE)
    height: int = Field(ge=1, le=exr.MAX_SIDE)
    layers: tuple[LayerRecord, ...] = Field(min_length=1)
    denoised: tuple[Denoised, ...] = ()
    shared: Literal["each", "once"] = "each"
    identities: tuple[IdentityRecord, ...]
    splits: tuple[SplitRecord, ...] = Field(min_length=1)
    shards: tuple[ShardRecord, ...]
    totals: Totals
    rejected: tuple[Rejected, ...]
    parts: tuple[ObjectSource, ...] = ()
    fields: tuple[FieldSummary, ...] = ()
    subset: SubsetRecord | None = None
    """Of a dataset whose examples were chosen from those of another; left out of the file of any other."""
    in_common: tuple[SharedContent, ...] = ()
    """What splits share, where the spec lets them; left out where they share nothing."""

    @model_serializer(mode="wrap")
    def _without_nothing(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in plain(self).items() if value or key not in ("subset", "in_common")}

    @property
    def through_fields(self) -> bool:
        """Whether `i_s` of some examples is the image of a field."""
        return any("i_s" in summary.gives for summary in self.fields)

    @property
    def captures(self) -> bool:
        """Whether something of what is seen is a capture of a real object."""
        return any(part.captured for part in self.parts)

    @model_validator(mode="after")
    def _names_differ(self) -> "Manifest":
        for what, records in (("layers", self.layers), ("splits", self.splits)):
            names = [record.name for record in records]
            if len(set(names)) < len(names):
                raise ValueError(f"expected {what} of different names")
        return self


def shard_slot(spec: DatasetSpec, split: str, number: int) -> str:
    """`<name>-v<major>-<split>-NNNNNN`, unique over all datasets that share a cache."""
    return f"{spec.name}-v{spec.version.partition('.')[0]}-{split}-{number:06d}"


def make_manifest(spec: DatasetSpec, *, layers: Mapping[str, Extent], shards: Sequence[ShardIndex],
                  rejected: Iterable[Rejected], spec_digest: str, generator: str, creator: str = "dataset-builder",
                  url: str = "", date_published: str = LAYOUT_DATE, denoised: Iterable[Denoised] = (),
                  parts: Iterable[ObjectSource] = (), fields: Iterable[FieldSummary] = (),
                  in_common: Iterable[SharedContent] = ()) -> Manifest:
    """The manifest of a dataset whose examples hold `layers` (name -> extent) and lie in `shards`, in that order."""
    fields = tuple(fields)
    seen = any("i_s" in summary.gives for summary in fields)
    refused = tuple(sorted(rejected, key=lambda item: item.key))
    empty = Manifest(
        name=spec.name, version=spec.version, title=spec.title or spec.name, description=spec.description,
        licence=spec.licence, creator=creator, url=url or f"urn:{FORMAT}:{spec.name}:{spec.version}",
        date_published=date_published, generator=generator, spec_digest=spec_digest,
        width=spec.image.width, height=spec.image.height,
        layers=tuple(layer_record(name, layers[name], spec.storage.dtype) for name in LAYERS if name in layers),
        denoised=tuple(denoised), shared=spec.storage.shared,
        identities=identity_records(spec.storage.dtype, seen),
        splits=tuple(SplitRecord(name=split.name, examples=0, shards=()) for split in spec.splits), shards=(),
        totals=Totals(examples=0, shards=0, bytes=0, rejected=len(refused)), rejected=refused,
        parts=tuple(parts), fields=fields, in_common=tuple(in_common),
    )
    return with_shards(empty, [index.shard for index in shards])


def identity_records(dtype: exr.DType, through_fields: bool) -> tuple[IdentityRecord, ...]:
    """The rules of layers stored as `dtype`; see `identity_table`."""
    return tuple(IdentityRecord(name=name, rule=rule, tolerance=tolerance)
                 for name, rule, tolerance in identity_table(dtype, through_fields))


def with_shards(manifest: Manifest, shards: Sequence[ShardRecord]) -> Manifest:
    """The manifest of the same dataset in these shards, in that order."""
    totals = manifest.totals.model_copy(update={
        "examples": sum(shard.examples for shard in shards), "shards": len(shards),
        "bytes": sum(shard.bytes for shard in shards)})
    splits = tuple(_split_record(split.name, shards) for split in manifest.splits)
    return manifest.model_copy(update={"splits": splits, "shards": tuple(shards), "totals": totals})


def layer_record(name: str, extent: Extent, dtype: exr.DType) -> LayerRecord:
    """The row of one layer."""
    layer = LAYERS[name]
    return LayerRecord(
        name=name, member=f"<key>.{name}.exr", symbol=layer.symbol, geometry=layer.geometry, extent=extent,
        channels=layer.channels, dtype=dtype, colour_space=exr.colour_space(name), unit=layer.unit,
        meaning=layer.meaning,
        range=f"[{layer.low:g}, {layer.high:g}]" if layer.high < float("inf") else f"[{layer.low:g}, inf)",
    )


def to_json(model: Model) -> bytes:
    """Canonical JSON of a manifest or an index, with a newline at its end."""
    return canonical_json(model.model_dump(mode="json")) + b"\n"


def from_json(model: type[M], data: bytes, *, where: str, extra: Literal["forbid", "ignore"] = "forbid") -> M:
    """A manifest, an index or a label from its JSON; extra: whether keys that are not known are passed over.

    Raises ShardError with every key that is wrong, or the first `MOST_PROBLEMS` of them.
    """
    try:
        return model.model_validate_json(data, extra=extra)
    except ValidationError as error:
        if not data.lstrip().startswith((b"{", b"[")):
            start = data[:LONGEST_VALUE].decode(errors="replace").strip()
            page = "a page of a server, such as a login or a listing, in its place" if start.startswith("<") else ""
            rule = f"expected JSON, got {f'text that begins with {start!r}' if start else 'an empty file'}"
            raise ShardError([Problem(where=where, path="", rule=rule, hint=page)]) from error
        issues = error.errors(include_url=False, include_context=False, include_input=False)[:MOST_PROBLEMS]
        problems = [Problem(where=where, rule=issue["msg"],
                            path=".".join(str(part)[:LONGEST_VALUE] for part in issue["loc"])) for issue in issues]
        raise ShardError(problems) from error


def _split_record(name: str, shards: Sequence[ShardRecord]) -> SplitRecord:
    own = [shard for shard in shards if shard.split == name]
    names = tuple(shard.name for shard in own)
    return SplitRecord(name=name, examples=sum(shard.examples for shard in own), shards=names)
