"""Merge the parts of a dataset: nothing is planned or rendered again."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dataset_builder.builder import Event
from dataset_builder.digest import digest
from dataset_builder.engine.finishing import Progress, finish, publish_task, require_examples
from dataset_builder.engine.outcomes import Rejections, Timings
from dataset_builder.engine.part_set import PartSet
from dataset_builder.engine.rejected_pixels import take_pixels
from dataset_builder.engine.shard_tasks import ShardTask, decide, shard_tasks, split_digests
from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import OutputError, Problem, ShardError
from dataset_builder.files import exhaustion_errors, require_space
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.cost import expected_bytes
from dataset_builder.planning.plan import Planner
from dataset_builder.shards.folder import Claim, require_ours
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import whole_shards
from dataset_builder.spec.resolve import LoadedSpec


def merge(loaded: LoadedSpec, parts: Sequence[Path], folder: Path, *, replace_other: bool = False,
          said: Callable[[str], None] = lambda text: None) -> Iterator[Event]:
    """Publish in `folder` the dataset that `parts`, folders in any order, staged between them; news as of `build`.

    The bytes are those of one build. Parts stay as they are, and shards that are there already, too. replace_other: as
    in `build`. said: called with what is odd, though no fault. Raises OutputError with every part that is missing, was
    made of another spec, by other versions or another backend, and with every example that is missing or damaged, each
    with the command that makes it; then no dataset is published, and a second run goes on.
    """
    claim = Claim(name=loaded.dataset.name, version=loaded.dataset.version)
    _require_apart(parts, folder)
    require_ours(folder, claim, replace=replace_other)
    planner = Planner(loaded)
    found = PartSet.of(loaded, planner.examples, parts)
    if len(found.processors) > 1:
        said(f"parts were made on different processors ({', '.join(found.processors)}): bytes may differ from those of "
             "one machine, within rounding and noise")
    made_by, progress = found.first.made_by, Progress()
    for record in found.records.values():
        progress.digests |= {key: example.digest for key, example in record.examples.items()}
        progress.rejected |= {item.key: item for item in record.rejected}
    with exhaustion_errors(folder), build_lock(folder, claim, replace=replace_other):
        digests = split_digests(planner.examples, loaded)
        tasks = decide(shard_tasks(planner.examples, loaded.dataset, digests),
                       [index for index in whole_shards(folder)
                        if all(progress.digests.get(each.key) == each.digest for each in index.examples)],
                       made_by, progress.rejected)
        require_examples(tasks, progress.rejected)
        progress.shards = {task.slot: task.keep for task in tasks if task.keep}
        missing = [task for task in tasks if not task.keep]
        if lost := found.missing(key for task in missing for key in _keys(task, progress)):
            raise found.lost(lost)
        wanted = sum(len(task.examples) for task in missing)
        require_space(folder, expected_bytes(loaded.dataset, wanted))
        yield Event(wanted=wanted)
        for task in missing:
            try:
                index = publish_task(task, folder, loaded, made_by, progress, found)
            except ShardError:
                lost += found.damaged(_keys(task, progress))
                if not lost:
                    raise
                continue
            yield Event(shard=index, outcomes=tuple(_outcome(ref, progress) for ref in task.examples))
        if lost:
            raise found.lost(lost)
        rejections, timings = Rejections(folder, digest(digests), made_by), Timings(folder)
        for number, record in found.records.items():
            rejections.add([item for item in record.rejected if item.key not in rejections.known])
            for item in record.rejected:
                take_pixels(folder, found.folders[number], item.key)
            timings.take(found.folders[number], record.examples.keys() | {item.key for item in record.rejected})
        timings.write()
        yield Event(manifest=finish(tasks, folder, planner, progress, found.first.denoised))


def _require_apart(parts: Sequence[Path], folder: Path) -> None:
    """Raise OutputError where the dataset would take the place of a part."""
    if folder.resolve() in {part.resolve() for part in parts}:
        raise OutputError([Problem(where=str(folder), path="", rule="expected another folder than those of the parts",
                                   hint="name a new folder with --out")])


def _keys(task: ShardTask, progress: Progress) -> list[str]:
    return [ref.key for ref in task.examples if ref.key in progress.digests]


def _outcome(ref: ExampleRef, progress: Progress) -> Outcome:
    return Outcome(ref=ref, digest=progress.digests.get(ref.key, ""), rejected=progress.rejected.get(ref.key),
                   kept=True)
