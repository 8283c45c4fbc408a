"""A shard of a dataset as formats take it: example by example, every file compared with its digest."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from pydantic import Field

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import Problem, ShardError
from dataset_builder.files import commit, discard_partial, partial_of, write_partial
from dataset_builder.shards.example import LABEL, PREVIEW
from dataset_builder.shards.shard_index import ExampleRecord, MemberRecord, ShardIndex
from dataset_builder.shards.structure import read_members
from dataset_builder.shards.writer import shard_path
from dataset_builder.spec.model import Model


class SourceRow(NamedTuple):
    """An example as it is stored: EXR files by layer, the label's JSON, and the PNG to look at (empty if none)."""

    example: ExampleRecord
    layers: dict[str, bytes]
    label: bytes
    preview: bytes


class ExportFile(Model):
    """A file that was written; name: relative to the export's folder; examples: those that it holds."""

    name: str
    bytes: int = Field(ge=0)
    sha256: str
    examples: int = Field(ge=0)


@dataclass(frozen=True, kw_only=True)
class SourceShard:
    """A shard, and which of its layers are wanted. number: among the `count` shards of its split."""

    folder: Path
    index: ShardIndex
    layers: tuple[str, ...]
    number: int
    count: int

    @property
    def split(self) -> str:
        """Split of all its examples."""
        return self.index.shard.split

    @property
    def tar(self) -> Path:
        """The file."""
        return shard_path(self.folder, self.index.shard.stem)

    def members(self, example: ExampleRecord) -> dict[str, MemberRecord]:
        """What is exported of an example, by suffix: its layers, its label, and its preview if it has one."""
        found = {member.suffix: member for member in example.members}
        return {suffix: found[suffix] for suffix in (*(f"{name}.exr" for name in self.layers), LABEL, PREVIEW)
                if suffix in found}

    def rows(self, examples: Iterable[ExampleRecord] | None = None) -> Iterator[SourceRow]:
        """Examples in order, all by default. Raises ShardError where a file is not what the index says."""
        for example in self.index.examples if examples is None else examples:
            members = self.members(example)
            data = dict(zip(members, read_members(self.tar, members.values()), strict=True))
            if wrong := [one for suffix, one in members.items() if sha256_bytes(data[suffix]) != one.sha256]:
                rule = f"expected SHA-256 {wrong[0].sha256}, its bytes differ"
                raise ShardError([Problem(where=self.tar.name, path=wrong[0].name, rule=rule,
                                          hint="build or download the dataset again; nothing is exported of it")])
            yield SourceRow(example=example, layers={name: data[f"{name}.exr"] for name in self.layers},
                            label=data[LABEL], preview=data.get(PREVIEW, b""))


def write_file(out: Path, name: str, chunks: Iterable[bytes], *, examples: int,
               check: Callable[[Path], None] = lambda partial: None) -> ExportFile:
    """Write a file of an export: aside, flushed, checked, renamed. Raises OutputError where it cannot be written, and
    what `check` raises of the finished file under its other name."""
    path = out / name
    try:
        size, sha256 = write_partial(path, chunks)
        check(partial_of(path))
    except BaseException:
        discard_partial(path)
        raise
    commit(path)
    return ExportFile(name=name, bytes=size, sha256=sha256, examples=examples)
