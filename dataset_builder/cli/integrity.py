"""The verbs `verify` and `repair`: whether a dataset is what was published, and making it so again."""

import argparse
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.cli import common
from dataset_builder.cli.rate_line import RateLine
from dataset_builder.errors import count_of
from dataset_builder.processes import cores

if TYPE_CHECKING:
    from dataset_builder.shards.verify_shard import Known

DEPTHS = ("size", "shard", "member", "pixels")
STATE = "verified"
"""Folder of what an interrupted run found out."""
STATE_SIZE = 2**30


def add(verbs: common.Verbs) -> None:
    """Add both verbs."""
    verify = common.add_verb(verbs, "verify", _verify, "check every file, example and identity of a dataset")
    common.add_folder(verify)
    verify.add_argument("--depth", choices=DEPTHS, default="pixels",
                        help="how far to look; each looks at all that the one before does (default: %(default)s)")
    verify.add_argument("--split", action="append", default=[], metavar="A",
                        help="look at the shards of split A alone; repeat for more")
    verify.add_argument("--workers", type=common.positive, help="processes (default: one per core)")
    repair = common.add_verb(verbs, "repair", _repair, "mend a damaged dataset to the bytes that were published")
    common.add_folder(repair)
    source = repair.add_mutually_exclusive_group(required=True)
    source.add_argument("--spec", type=Path, help="render what is broken again, from the spec that it was built from")
    source.add_argument("--from", dest="place", metavar="PLACE",
                        help="fetch what is broken from a whole copy: a folder, or an address as `pull` takes")
    common.add_overrides(repair, "the spec")
    repair.add_argument("--workers", type=common.positive, help="processes that render (default: one per core)")
    common.add_backend(repair)


def _verify(options: argparse.Namespace) -> int:
    from dataset_builder.shards.reader import load_manifest
    from dataset_builder.shards.verify import NOT_LOOKED_AT, verify

    with closing(RateLine()) as line, _state(options.folder, options.depth) as known:
        problems = verify(options.folder, depth=options.depth, splits=options.split, known=known, told=line.told,
                          workers=options.workers or cores())
    for problem in problems:
        print(f"wrong: {problem}")
    if left := NOT_LOOKED_AT[options.depth]:
        print(f"not looked at, with --depth {options.depth}: {left}")
    if problems:
        print(f"{len(problems)} problem{'s' if len(problems) > 1 else ''}")
        return 1
    manifest = load_manifest(options.folder)
    if others := [split.name for split in manifest.splits if options.split and split.name not in options.split]:
        print(f"not looked at: shards of {', '.join(others)}")
    if options.depth == DEPTHS[-1] and (unknown := _unknown(options.folder, options.split)):
        print(unknown)
    shards = [shard for shard in manifest.shards if not options.split or shard.split in options.split]
    print(f"{count_of(sum(shard.examples for shard in shards), 'example')} in {count_of(len(shards), 'shard')}, "
          f"{sum(shard.bytes for shard in shards)} bytes: no problems found")
    return 0


def _repair(options: argparse.Namespace) -> int:
    from dataset_builder.remote.open_place import place_of
    from dataset_builder.shards.folder import ASIDE, WORK
    from dataset_builder.transfer.refetch import repair_from

    if options.spec:
        from dataset_builder.report.build_progress import Following
        from dataset_builder.spec.load import load_dataset
        from dataset_builder.transfer.rerender import repair_with

        done = repair_with(load_dataset(options.spec, options.overrides), options.folder, backend=options.backend,
                           workers=options.workers, events=Following(common.plain_console()).events)
    else:
        done = repair_from(options.folder, place_of(options.place))
    for name in done.aside:
        print(f"not of the dataset, moved to {options.folder / WORK / ASIDE}: {name}")
    for name in done.mended:
        print(f"mended: {name}")
    if done.rendered:
        print(f"rendered again: {', '.join(done.rendered)}")
    if done.fetched:
        print(f"fetched: {done.fetched} bytes, of them {len(done.members)} members alone")
    print("every file has the bytes that were published" if done.mended else "nothing to mend")
    return 0


def _unknown(folder: Path, splits: Sequence[str]) -> str:
    """A sentence on layers whose means are not known, if there are any: nothing wrong, but not to be relied on."""
    from dataset_builder.label.mean_told import means_told, unknown_means
    from dataset_builder.shards.reader import open_dataset

    dataset = open_dataset(folder, layers=())
    keys = (key for split, keys in dataset.splits.items() if not splits or split in splits for key in keys)
    found = unknown_means(layer for label in dataset.labels(keys) for layer in label.record.layers)
    return means_told(found) if found else ""


@contextmanager
def _state(folder: Path, depth: str) -> Iterator["Known | None"]:
    """Where a run that is interrupted leaves what it found out, for the next one: in the user's cache, since a dataset
    that somebody else made could bring findings of its own. It is gone after a run that came to its end."""
    from dataset_builder.byte_store import ByteStore, user_cache
    from dataset_builder.digest import digest
    from dataset_builder.engine.source import source_digest
    from dataset_builder.shards.folder import MANIFEST
    from dataset_builder.shards.verify_shard import Known
    from dataset_builder.shards.writer import writer_versions

    cache = user_cache(STATE)
    state = cache / digest(str(folder.resolve()))[:16]
    if depth not in ("member", "pixels") or not (folder / MANIFEST).is_file() or not _writable(state):
        yield None
        return
    if any(state.iterdir()):
        print("going on with what an interrupted run found out", file=sys.stderr)
    code = ":".join([source_digest("shards.verify"), *map(str, writer_versions().items())])
    yield Known(store=ByteStore(state, STATE_SIZE), code=code)
    shutil.rmtree(state, ignore_errors=True)
    with suppress(OSError):
        cache.rmdir()
        cache.parent.rmdir()


def _writable(folder: Path) -> bool:
    from dataset_builder.errors import OutputError
    from dataset_builder.files import require_writable

    try:
        require_writable(folder)
    except OutputError:
        return False
    return True
