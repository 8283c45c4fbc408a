"""All parts of a dataset: whether they are there, belong together and are whole."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from shlex import join

from dataset_builder.engine.dataset_part import DatasetPart, PartRecord, parts_of, read_record
from dataset_builder.engine.made_by import own_versions
from dataset_builder.errors import OutputError, Problem
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.shards.staging import Staged, Staging
from dataset_builder.spec.resolve import LoadedSpec

NAMED = 100
"""Damaged examples that are named; of the rest only how many there are."""


@dataclass(frozen=True, kw_only=True)
class PartSet:
    """Parts that make a dataset, by their number."""

    loaded: LoadedSpec
    folders: Mapping[int, Path]
    records: Mapping[int, PartRecord]

    @classmethod
    def of(cls, loaded: LoadedSpec, examples: Sequence[ExampleRef], folders: Sequence[Path]) -> "PartSet":
        """The parts in some folders, in any order; the same one may come twice. Raises OutputError with all that is
        missing or does not belong to the others."""
        found = {folder: read_record(folder) for folder in dict.fromkeys(folders)}
        records = {folder: record for folder, record in found.items() if record}
        problems = [_wrong(folder, "expected a finished part, found none", _command(loaded, "k/n", folder))
                    for folder in sorted(found.keys() - records.keys())]
        problems += [_wrong(folder, f"expected a part of {loaded.path} as it is now, got part {record.part} of another "
                            "spec, or of other values of --set", _command(loaded, record.part, folder))
                     for folder, record in records.items() if record.spec_digest != loaded.spec_digest]
        if records and not problems:
            problems = list(_strangers(loaded, records)) or list(_gaps(loaded, examples, records))
        if problems or not records:
            raise OutputError(problems or "expected parts, got none")
        # The first of those that came twice
        numbered = {record.number: folder for folder, record in reversed(records.items())}
        return cls(loaded=loaded, folders=numbered, records={number: records[folder]
                                                             for number, folder in sorted(numbered.items())})

    @property
    def first(self) -> PartRecord:
        """What the records of all parts have in common is the same in this one."""
        return self.records[1]

    @property
    def processors(self) -> list[str]:
        """What made them, each once."""
        return sorted({record.processor for record in self.records.values()})

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {key: number for number, record in self.records.items() for key in record.examples}

    def get(self, key: str, digest: str, /) -> Staged:
        """A staged example, its bytes those that the record says. Raises ShardError."""
        number = self._numbers[key]
        return Staging(self.folders[number]).get(key, digest, self.records[number].examples[key].sha256)

    def missing(self, keys: Iterable[str]) -> list[str]:
        """Those of some examples whose files are not there."""
        return [key for key in keys if not Staging(self.folders[self._numbers[key]]).there(key, self._digest(key))]

    def damaged(self, keys: Iterable[str]) -> list[str]:
        """Those of some examples that cannot be read as they were staged."""
        return [key for key in keys if not Staging(self.folders[number := self._numbers[key]]).has(
            key, self._digest(key), self.records[number].examples[key].sha256)]

    def lost(self, keys: Sequence[str]) -> OutputError:
        """That examples are missing or damaged, with the commands that make them again."""
        problems = [_wrong(self.folders[number], f"example {key} of part {self.records[number].part} is missing or "
                           "damaged", _command(self.loaded, self.records[number].part, self.folders[number]))
                    for key in islice(keys, NAMED) for number in [self._numbers[key]]]
        more = [Problem(where="", path="", rule=f"and {len(keys) - NAMED} more")] if len(keys) > NAMED else []
        return OutputError([*problems, *more])

    def _digest(self, key: str) -> str:
        return self.records[self._numbers[key]].examples[key].digest


def _strangers(loaded: LoadedSpec, records: Mapping[Path, PartRecord]) -> Iterator[Problem]:
    """Parts that were made in another way than the first one, or by other code than this."""
    (first, model), *others = records.items()
    own, hint = own_versions(loaded.dataset), "merge with the code that made the parts, or make them again with this"
    if change := _changes(own, {name: model.made_by.get(name, "none") for name in own}):
        yield _wrong(first, f"expected part {model.part} to be made by the code that merges it, got {change}", hint)
    for folder, record in others:
        alike = f"expected part {record.part} to be like part {model.part} in {first}, got"
        if record.of != model.of:
            yield _wrong(folder, f"{alike} one of {record.of} parts in place of {model.of}",
                         _command(loaded, f"k/{model.of}", folder))
        elif change := _changes(model.made_by, record.made_by):
            yield _wrong(folder, f"{alike} {change}", "make all parts with the same versions and one --backend")
        elif record.denoised != model.denoised:
            yield _wrong(folder, f"{alike} other figures of denoised layers ({record.processor} in place of "
                         f"{model.processor})", "make all parts on one kind of processor")


def _changes(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {now.get(name, 'none')} in place of {before.get(name, 'none')}"
                     for name in sorted({*before, *now}) if before.get(name) != now.get(name))


def _gaps(loaded: LoadedSpec, examples: Sequence[ExampleRef], records: Mapping[Path, PartRecord]) -> Iterator[Problem]:
    """Parts that are not there, hold other examples than they should, or came twice and differ."""
    count = next(iter(records.values())).of
    wanted: dict[int, set[str]] = {number: set() for number in range(1, count + 1)}
    for part, unit in parts_of(loaded.dataset, examples, count):
        wanted[part.number] |= {ref.key for ref in unit.examples}
    there = dict[int, Path]()
    for folder, record in records.items():
        before = there.setdefault(record.number, folder)
        if {*record.examples, *(item.key for item in record.rejected)} != wanted[record.number]:
            yield _wrong(folder, f"expected the examples of part {record.part}, got others",
                         _command(loaded, record.part, folder))
        elif (records[before].examples, records[before].rejected) != (record.examples, record.rejected):
            yield _wrong(folder, f"expected one part {record.part}, got another in {before}", "leave one of them out")
    for number in sorted(wanted.keys() - there.keys()):
        part = DatasetPart(number, count)
        yield Problem(where="", path="", rule=f"expected part {part}, found none",
                      hint=f"make it: {_command(loaded, part, Path('DIR'))}")


def _command(loaded: LoadedSpec, part: DatasetPart | str, folder: Path) -> str:
    sets = [text for override in loaded.overrides for text in ("--set", override)]
    return join(["dataset-builder", "build", str(loaded.path), *sets, "--part", str(part), "--out", str(folder)])


def _wrong(folder: Path, rule: str, hint: str) -> Problem:
    return Problem(where=str(folder), path="", rule=rule, hint=hint)
