"""One dataset, one backend: bytes of CPUs and of GPUs differ, so a build that would make another's examples again says
so first."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from dataset_builder.digest import sealed, unsealed
from dataset_builder.engine.shard_tasks import ShardTask
from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import write_atomic
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.staging import Staging

BACKEND = "backend.json"
"""File below `.build` that says on which backend the last build was allowed to go on."""
VARIANT = "variant"
"""Key of `versions` and of that file."""


class OneBackend:
    """Which backend made the examples that are in a folder, next to the one that would go on."""

    def __init__(self, folder: Path, tasks: Sequence[ShardTask], made_by: Mapping[str, str]):
        self._folder, self._path, self._ours = folder, folder / WORK / BACKEND, made_by[VARIANT]
        self._wanted = {task.slot: task.spec_digest for task in tasks}
        self._others = Counter[str]()

    def watched(self, whole: Iterable[ShardIndex]) -> Iterator[ShardIndex]:
        """Pass whole shards on, and count the examples of those that another backend made of the same spec."""
        for index in whole:
            variant = index.versions.get(VARIANT, "another version")
            if variant != self._ours and self._wanted.get(index.shard.slot) == index.spec_digest:
                self._others[variant] += len(index.examples)
            yield index

    def require(self, replace: bool) -> None:
        """Go on with this backend, and remember that, once the shards have been watched. Raises OutputError where
        another made examples of the same spec, finished or staged, unless they may go; nothing was changed then."""
        last = self._last()
        if last == self._ours:
            return
        others = Counter(self._others)
        if last and (staged := len(Staging(self._folder).known())):
            others[last] += staged
        if others and not replace:
            raise OutputError([self._refused(others)])
        write_atomic(self._path, sealed({VARIANT: self._ours}))

    def _last(self) -> str:
        """What the last build went on with; empty where that is not known."""
        try:
            content = unsealed(self._path.read_bytes())
        except OSError:
            return ""
        return str(content[VARIANT]) if content and VARIANT in content else ""

    def _refused(self, others: Counter[str]) -> Problem:
        counts = ", ".join(f"{count} made by {variant}" for variant, count in others.most_common())
        backends = " or ".join(f"--backend {variant.partition('_')[0]}" for variant, _ in others.most_common())
        return Problem(
            where=str(self._folder), path="",
            rule=f"expected examples of {self._ours}, which renders here, got {counts}: bytes of two backends differ, "
                 f"so all {others.total()} would be made again",
            hint=f"go on with {backends}, choose another output folder, or say --replace to make them again; no "
                 "example was changed")
