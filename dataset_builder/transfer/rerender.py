"""Mending a damaged dataset from its spec: broken examples are rendered again, whole ones stay. The result has the
bytes that were published, or nothing is changed."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from dataset_builder.builder import Event, build
from dataset_builder.engine.made_by import versions
from dataset_builder.engine.shard_tasks import split_digests
from dataset_builder.files import write_atomic
from dataset_builder.planning.plan import Planner
from dataset_builder.shards.folder import MANIFEST, SUMS, Claim, next_of, write_claim
from dataset_builder.shards.one_writer import one_writer
from dataset_builder.shards.publish import Again, published, sums_in
from dataset_builder.shards.verify_files import hash_of
from dataset_builder.shards.writer import index_path, shard_path
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.transfer.anchor import Anchor, Repaired, anchor_of, refused
from dataset_builder.transfer.aside import bring_back, set_aside
from dataset_builder.transfer.reindex import reindexed


def repair_with(loaded: LoadedSpec, folder: Path, *, backend: str = "auto", workers: int | None = None,
                events: Callable[[Iterator[Event]], Iterator[Event]] = iter) -> Repaired:
    """Render whatever is broken in `folder` again, from the spec that it was built from; whole examples stay.

    events: passes the news of the build on. Raises ShardError where the folder does not tell what it held, UserError
    where that was made from another spec or by other versions, or comes out other than it was. The dataset is then as
    it was.
    """
    with one_writer(folder, "repair"):
        anchor = anchor_of(folder)
        made_by, digests = versions(backend, loaded.dataset), split_digests(Planner(loaded).examples, loaded)
        _require_same_maker(folder, anchor, loaded, made_by, frozenset(digests.values()))
        broken = _broken(folder, anchor)
        aside = set_aside(folder, anchor.files)
        if not broken:
            return Repaired(aside=aside)
        hashes = {name: hash_of(folder / name, most=None) for name in broken}
        before = dict(_reindex(folder, broken, loaded.dataset, made_by, digests))
        write_claim(folder, Claim(name=loaded.dataset.name, version=loaded.dataset.version, files=tuple(sorted(
            {*(name for name in anchor.files if (folder / name).exists()), SUMS}))))
    known = anchor.manifest
    again = Again(sha256=anchor.sha256, rejected=known.rejected if known else (),
                  denoised=known.denoised if known else ())
    rendered = list[str]()
    waiting = next_of(folder).exists()
    try:
        for event in events(build(loaded, folder, backend=backend, workers=workers, again=again)):
            rendered += [outcome.ref.key for outcome in event.outcomes if not outcome.kept]
    except BaseException:
        if not waiting:
            shutil.rmtree(next_of(folder), ignore_errors=True)
        bring_back(folder, aside)
        for path, data in before.items():
            path.unlink() if data is None else write_atomic(path, data)
        raise
    mended = tuple(name for name in broken if hash_of(folder / name, most=None) != hashes[name])
    return Repaired(mended=mended, rendered=tuple(sorted(rendered)), aside=aside)


def _reindex(folder: Path, broken: list[str], spec: DatasetSpec, made_by: dict[str, str],
             digests: Mapping[str, str]) -> Iterator[tuple[Path, bytes | None]]:
    """Make the indexes of whole shards again, so that nothing of those is rendered; what was in their places."""
    for name in broken:
        stem = Path(name).stem
        tar = shard_path(folder, stem)
        if name != index_path(Path(), stem).as_posix() or shard_path(Path(), stem).as_posix() in broken:
            continue
        if data := reindexed(tar, spec, made_by, digests):
            path = folder / name
            there = path.read_bytes() if path.is_file() else None
            write_atomic(path, data)
            yield path, there


def _broken(folder: Path, anchor: Anchor) -> list[str]:
    """Files that are not what they were, or of which the folder does not tell."""
    stated = anchor.sums | {MANIFEST: anchor.sha256}
    if anchor.manifest:
        stated |= {shard.tar_file: shard.sha256 for shard in anchor.manifest.shards}
    found = [name for name in anchor.files if hash_of(folder / name, most=None) != stated.get(name, "")]
    lines = sorted(filter(None, sums_in(anchor.listed)))
    whole = [(name, stated.get(name)) for name in anchor.files] == lines and len(sums_in(anchor.listed)) == len(lines)
    return [*found, *([] if whole else [SUMS])]


def _require_same_maker(folder: Path, anchor: Anchor, loaded: LoadedSpec, here: Mapping[str, str],
                        specs: frozenset[str]) -> None:
    """Raise UserError where the dataset was made from another spec, or by other versions."""
    if anchor.manifest and anchor.manifest.spec_digest != loaded.spec_digest:
        raise refused(folder, f"expected the spec that {MANIFEST} names ({anchor.manifest.spec_digest[:12]}), got "
                              f"another ({loaded.spec_digest[:12]})", "use the spec and --set that it was built with")
    stems = sorted({Path(name).stem for name in anchor.files if name.endswith(".tar")})
    for index in (index for stem in stems if (index := published(folder, stem))):
        if index.spec_digest not in specs:
            raise refused(folder, f"expected the spec that {index.shard.name} was built from, got another",
                          "use the spec and the --set that it was built with")
        if other := sorted(name for name in {*here, *index.versions} if here.get(name) != index.versions.get(name)):
            told = "; ".join(f"{name}: {index.versions.get(name, 'none')[:40]}, here {here.get(name, 'none')[:40]}"
                             for name in other)
            raise refused(folder, f"expected the versions that made it: {told}",
                           "install those, or use --from")
        return
