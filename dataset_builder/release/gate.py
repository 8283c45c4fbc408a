"""The release gate: is a dataset ready for release? Four parts, cheap ones first, each a list of checks.

files        every file, hash, label and identity (`shards.verify`)
consistency  layers that agree with each other (`release.consistency`)
loader       what training reads of it (`release.training_checks`)
training     LighTNet from scratch against untrained baselines (`release.training_checks`)
"""

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from dataset_builder.errors import UserError
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.lightnet.training.events import Event
from dataset_builder.lightnet.training.fit import TrainingJob
from dataset_builder.release.consistency import EXAMPLES, Facts, check_facts, read_facts
from dataset_builder.release.dataset_check import Check, Rule
from dataset_builder.release.training_checks import COPY_MARGIN, MARGIN, loader_checks, training_checks
from dataset_builder.shards.verify import verify

LISTED = 3
"""Problems that a check names; a report has all."""

FILES = Rule(name="files", high=0, why="none, by the definition of the format",
             statement="problems that `dataset-builder verify` finds")
READS = Rule(name="reads", high=0, why="what cannot be read cannot be trained on",
             statement="errors that stopped this part early")


@dataclass(frozen=True, kw_only=True)
class Gate:
    """What to ask of which dataset."""

    dataset: Path | str
    out: Path
    """Folder that the training may use."""
    spec: TrainingSpec
    """Of the training."""
    parts: tuple[str, ...]
    """Some of `PARTS`."""
    margin: float = MARGIN
    """See `training_checks`, as for `copy_margin`."""
    copy_margin: float = COPY_MARGIN
    examples: int = EXAMPLES
    """Most that consistency looks at."""
    device: str = "auto"
    vgg_weights: Path | None = None
    stop: bool = True
    """Whether parts after one that failed are left out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PartResult:
    """What a part found."""

    checks: tuple[Check, ...]
    problems: tuple[str, ...] = ()
    """Sentences, all of them."""
    facts: tuple[Facts, ...] = ()
    """What figures are made from, as are `rows`."""
    rows: tuple[ScoreRow, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Begun:
    """News: a part begins."""

    part: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Done:
    """News: a part is done, after so many seconds."""

    part: str
    found: PartResult
    seconds: float

    @property
    def holds(self) -> bool:
        """Whether every check of the part holds."""
        return all(check.holds for check in self.found.checks)


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """News: parts that were asked for are not run, since one before them failed."""

    parts: tuple[str, ...]


News = Begun | Done | LeftOut | Event


def run(gate: Gate) -> Iterator[News]:
    """Run the parts asked for, in the order of `PARTS`, with news of the training in between.

    A UserError inside a part is a check that fails: a dataset that cannot be read is no dataset to release.
    """
    wanted = [name for name in PARTS if name in gate.parts]
    for number, name in enumerate(wanted, start=1):
        yield Begun(part=name)
        start = perf_counter()
        try:
            found = yield from PARTS[name](gate)
        except UserError as error:
            found = _problems(READS, [str(problem) for problem in error.problems])
        done = Done(part=name, found=found, seconds=perf_counter() - start)
        yield done
        if gate.stop and not done.holds and wanted[number:]:
            yield LeftOut(parts=tuple(wanted[number:]))
            return


Part = Generator[Event, None, PartResult]


def _files(gate: Gate) -> Part:
    yield from ()
    return _problems(FILES, [str(problem) for problem in verify(Path(gate.dataset))])


def _consistency(gate: Gate) -> Part:
    yield from ()
    facts = tuple(read_facts(gate.dataset, gate.examples))
    return PartResult(checks=tuple(check_facts(facts)), facts=facts)


def _loader(gate: Gate) -> Part:
    yield from ()
    return PartResult(checks=tuple(loader_checks(gate.dataset, gate.spec.data)))


def _training(gate: Gate) -> Part:
    job = TrainingJob(dataset=gate.dataset, out=gate.out / "training", spec=gate.spec, device=gate.device,
                      vgg_weights=gate.vgg_weights)
    checks, rows = yield from training_checks(job, margin=gate.margin, copy_margin=gate.copy_margin)
    return PartResult(checks=tuple(checks), rows=tuple(rows))


PARTS: dict[str, Callable[[Gate], Part]] = {
    "files": _files, "consistency": _consistency, "loader": _loader, "training": _training,
}
"""By name, in the order they are run in."""


def _problems(rule: Rule, sentences: list[str]) -> PartResult:
    more = f"; and {len(sentences) - LISTED} more" if len(sentences) > LISTED else ""
    return PartResult(checks=(rule.judge(len(sentences), "; ".join(sentences[:LISTED]) + more),),
                      problems=tuple(sentences))
