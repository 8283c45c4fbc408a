"""The index of a shard: where every file of every example is. Like the manifest, it contains no time of a build."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from dataset_builder.digest import digest
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.shards.folder import INDEX, SHARDS
from dataset_builder.spec.model import Model

Count = Annotated[int, Field(ge=0, lt=2**53)]
Key = Annotated[str, Field(pattern="^[0-9]{8}$")]
TAG_DIGITS = 8


class MemberRecord(Model):
    """One file of a shard: name, where its bytes are, and digests of bytes and of decoded pixels (empty for JSON)."""

    name: str
    offset: Count
    size: int = Field(ge=0, lt=2**31)
    sha256: str
    pixel_digest: str

    @property
    def key(self) -> str:
        """Key of the example that the file was written for: all up to the first dot."""
        return self.name.partition(".")[0]

    @property
    def suffix(self) -> str:
        """What the file is of its example, such as `i_s.exr`."""
        return self.name.partition(".")[2]


class ExampleFacts(Model):
    """What examples are chosen by, of the plan of one."""

    object: str
    """Name of the target object."""
    category: str
    """Of the target object."""
    scene: str
    """Name of the room or scene around it."""
    light: int = Field(ge=0)
    """Number of the target light among those of the view."""
    level: int = Field(ge=0)
    """Number of the noise level."""
    level_name: str
    """Of the noise level; empty where it has none."""

    @classmethod
    def of(cls, plan: ExamplePlan) -> "ExampleFacts":
        """Those of a plan."""
        target = plan.target.object
        return cls(object=target.name, category=target.category, scene=plan.room.name, light=plan.light,
                   level=plan.rough.level, level_name=plan.rough.name)


class ExampleRecord(Model):
    """One example of a shard. digest: of the plan and versions that it was made from; members: by suffix, its own in
    file order. Others lie with an earlier example of the view, which has the same pixels."""

    key: Key
    view: str
    facts: ExampleFacts
    digest: str
    members: tuple[MemberRecord, ...]

    @property
    def own(self) -> tuple[MemberRecord, ...]:
        """Members that lie in the shard under the example's own key."""
        return tuple(member for member in self.members if member.key == self.key)


class ShardRecord(Model):
    """One shard: `name` is its file below `shards/`."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9._-]*\.tar$", max_length=240)
    split: str
    bytes: Count
    sha256: str
    examples: Count
    first_key: str
    last_key: str

    @property
    def stem(self) -> str:
        """Name without `.tar`: the stem of the index, too."""
        return self.name.removesuffix(".tar")

    @property
    def tar_file(self) -> str:
        """The shard, relative to its dataset."""
        return f"{SHARDS}/{self.name}"

    @property
    def index_file(self) -> str:
        """Its index, relative to its dataset."""
        return f"{INDEX}/{self.stem}.manifest"

    @property
    def files(self) -> tuple[str, str]:
        """`tar_file` and `index_file`."""
        return self.tar_file, self.index_file

    @property
    def slot(self) -> str:
        """`stem` without the tag: the shard's place in its dataset, as `shard_slot` names it."""
        return self.stem.rpartition("-")[0]


class ShardIndex(Model):
    """What `index/<stem>.manifest` holds: the shard, what made it, and where every member is."""

    schema_version: Literal["1"] = "1"
    shard: ShardRecord
    spec_digest: str
    versions: dict[str, str]
    examples: tuple[ExampleRecord, ...]

    @model_validator(mode="after")
    def _shares_within_views(self) -> "ShardIndex":
        """A member of another key is one that an earlier example of the same view owns, exactly as listed there."""
        owned = dict[str, tuple[str, MemberRecord]]()
        for example in self.examples:
            for member in example.members:
                if member.key != example.key and owned.get(member.name) != (example.view, member):
                    raise ValueError(f"expected members of {example.key}, or of an earlier example of its view as they "
                                     f"are listed there, got {member.name!r:.60}")
            owned |= {member.name: (example.view, member) for member in example.own}
        return self


def tagged(index: ShardIndex, slot: str) -> ShardIndex:
    """The index of the shard in `slot` with its name: `<slot>-<tag>.tar`. The tag is a digest of all else that the
    index says, so that other content has another name, and an index that was changed does not fit its own."""
    def named(name: str) -> ShardIndex:
        return index.model_copy(update={"shard": index.shard.model_copy(update={"name": name})})

    return named(f"{slot}-{digest(named(slot).model_dump(mode='json'))[:TAG_DIGITS]}.tar")
