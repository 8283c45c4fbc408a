"""A part of a dataset, staged on a machine of its own: which views it has, and what became of them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from dataset_builder.digest import sealed, unsealed
from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import UserError
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.label.example_label import Denoised
from dataset_builder.planning.catalogue import ExampleRef, ViewUnit, units
from dataset_builder.planning.unit_cost import unit_seconds
from dataset_builder.processes import processor
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.shard_index import Key
from dataset_builder.shards.staging import Staging
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.model import Model

RECORD = "part.json"
"""File below `.build` that says what a part holds. It is written last: where it is, the part was whole."""

MOST_PARTS = 100_000
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


@dataclass(frozen=True, order=True)
class DatasetPart:
    """Part `number` of `of`, from 1 on."""

    number: int
    of: int

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    @classmethod
    def parse(cls, text: str) -> "DatasetPart":
        """`2/3`. Raises UserError where it is something else."""
        first, slash, last = text.partition("/")
        if slash and all(part.isascii() and part.isdigit() and len(part) < 7 for part in (first, last)) and \
                1 <= int(first) <= int(last) <= MOST_PARTS:
            return cls(int(first), int(last))
        raise UserError(f"--part: expected k/n with k from 1 to n, as 2/3, and n at most {MOST_PARTS:,}, got {text!r}")


class StagedRecord(Model):
    """One staged example: what it was made from, and its bytes."""

    digest: Digest
    sha256: Digest


class PartRecord(Model):
    """What `.build/part.json` holds, sealed."""

    format: Literal["3df-lighting part"] = "3df-lighting part"
    spec_digest: str
    number: int
    of: int
    made_by: dict[str, str]
    processor: str
    denoised: tuple[Denoised, ...]
    examples: dict[Key, StagedRecord]
    rejected: tuple[Rejected, ...]

    @property
    def part(self) -> DatasetPart:
        """Which one it is."""
        return DatasetPart(self.number, self.of)


def parts_of(spec: DatasetSpec, examples: Iterable[ExampleRef], count: int) -> Iterator[tuple[DatasetPart, ViewUnit]]:
    """Every view, with the part that it is in. All views are put in order of split, object, scene and camera, and that
    row is cut into `count` pieces of equal cost, so that a part sees few objects.

    Costs are whole milliseconds from the spec alone, so that every machine cuts alike. A part may be empty, where there
    are more parts than views.
    """
    splits = {split.name: number for number, split in enumerate(spec.splits)}

    def order_of(unit: ViewUnit) -> tuple[int, ...]:
        pair = unit.view.pair
        return splits[pair.split], pair.object, pair.scene, unit.view.camera

    row, costs = sorted(units(examples), key=order_of), dict[str, int]()
    for unit in row:
        # Views of a split have the same number of examples
        if (split := unit.view.pair.split) not in costs:
            costs[split] = max(round(1000 * unit_seconds(spec, unit)), 1)
    total, before = sum(costs[unit.view.pair.split] for unit in row), 0
    for unit in row:
        cost = costs[unit.view.pair.split]
        # By the middle of each
        yield DatasetPart((2 * before + cost) * count // (2 * total) + 1, count), unit
        before += cost


def read_record(folder: Path) -> PartRecord | None:
    """The record of the part in a folder; None where there is none, or it is damaged."""
    try:
        content = unsealed((folder / WORK / RECORD).read_bytes())
        return None if content is None else PartRecord.model_validate(content)
    except (OSError, ValidationError):
        return None


def write_record(folder: Path, part: DatasetPart, spec_digest: str, made_by: Mapping[str, str],
                 denoised: Sequence[Denoised], digests: Mapping[str, str], rejected: Iterable[Rejected]) -> PartRecord:
    """Say that a part is whole. digests: of its staged examples, by key. Raises OutputError, and ShardError where one
    of them is not staged."""
    staging = Staging(folder)
    examples = {key: StagedRecord(digest=digest, sha256=staging.sha256_of(key, digest))
                for key, digest in sorted(digests.items())}
    record = PartRecord(spec_digest=spec_digest, number=part.number, of=part.of, made_by=dict(made_by),
                        processor=processor(), denoised=tuple(denoised), examples=examples,
                        rejected=tuple(sorted(rejected, key=lambda item: item.key)))
    write_atomic(folder / WORK / RECORD, sealed(record.model_dump(mode="json")))
    return record


def known_outcomes(folder: Path, part: DatasetPart, spec_digest: str, made_by: Mapping[str, str],
                   refs: Iterable[ExampleRef]) -> list[Outcome]:
    """Those of some examples that are staged, as the record of this very part in the folder says: nothing is planned
    for them. The record of another part, spec or version is removed. Raises OutputError."""
    record, staging = read_record(folder), Staging(folder)
    if record is None or (record.part, record.spec_digest, record.made_by) != (part, spec_digest, made_by):
        with output_errors(folder):
            (folder / WORK / RECORD).unlink(missing_ok=True)
        return []
    return [Outcome(ref=ref, digest=known.digest, kept=True) for ref in refs
            if (known := record.examples.get(ref.key)) and staging.has(ref.key, known.digest, known.sha256)]
