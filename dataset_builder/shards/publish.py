"""From shards to a dataset: card, Croissant, checksums and `dataset.json` are written, and all goes to its place."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.digest import sha256_bytes, sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.label.example_label import Denoised
from dataset_builder.shards.card import card
from dataset_builder.shards.croissant import croissant
from dataset_builder.shards.folder import CARD, CROISSANT, INDEX, MANIFEST, SUMS, files_of, next_of, read_claim
from dataset_builder.shards.manifest import Manifest, Rejected, from_json, to_json
from dataset_builder.shards.one_writer import swap
from dataset_builder.shards.shard_index import ShardIndex, tagged
from dataset_builder.shards.structure import read_small, tar_problems
from dataset_builder.shards.writer import index_path, shard_path

_SUM = re.compile(r"([0-9a-f]{64})  (\S.*)")


@dataclass(frozen=True, kw_only=True)
class Again:
    """A dataset that is built again because some of it is damaged, and what is known of it."""

    sha256: str
    """Of its `dataset.json`."""
    rejected: tuple[Rejected, ...] = ()
    denoised: tuple[Denoised, ...] = ()


def publish_dataset(folder: Path, manifest: Manifest, again: Again | None = None) -> None:
    """Write everything but the shards, and let the whole set take the place of the old one (`folder.swap`).

    again: what must come out, where that is known. Raises ShardError where it does not, and where a shard that the
    manifest lists is not whole, OutputError where the disk refuses.
    """
    if again and (got := sha256_bytes(to_json(manifest))) != again.sha256:
        rule = f"expected the one with SHA-256 {again.sha256} again, got another, with {got}"
        raise ShardError([Problem(where=str(folder), path=MANIFEST, rule=rule)])
    roots = _roots(folder, manifest)
    texts = {CARD: card(manifest).encode(), CROISSANT: croissant(manifest).encode(), MANIFEST: to_json(manifest)}
    known = {shard.tar_file: shard.sha256 for shard in manifest.shards}
    known |= {shard.index_file: sha256_file(roots[shard.stem] / shard.index_file) for shard in manifest.shards}
    known |= {name: sha256_bytes(data) for name, data in texts.items()}
    texts[SUMS] = sums_of(known, manifest)
    for name, data in texts.items():
        write_atomic(next_of(folder) / name, data)
    swap(folder)


def published(folder: Path, stem: str) -> ShardIndex | None:
    """The index of a shard below `folder` that is whole; else None.

    The index must be what its name says, byte by byte, and the tar, byte by byte, what the index says.
    """
    path = shard_path(folder, stem)
    try:
        data = read_small(index_path(folder, stem))
        index = from_json(ShardIndex, data, where=stem)
        sealed = tagged(index, index.shard.slot)
        whole = index.shard.stem == stem and to_json(sealed) == data and path.stat().st_size == index.shard.bytes
        return index if whole and not tar_problems(path, index) else None
    except (OSError, ShardError):
        return None


def whole_shards(folder: Path) -> Iterator[ShardIndex]:
    """Shards that are whole, as a build goes on from them: those of the set in its place, as its `dataset.json` lists
    them, then those that wait for the next set."""
    claim = read_claim(folder)
    try:
        listed = from_json(Manifest, read_small(folder / MANIFEST), where=MANIFEST).shards
    except ShardError:
        listed = None
    for stem in _stems(claim.files if claim else ()):
        index = published(folder, stem)
        if index and (listed is None or index.shard in listed):
            yield index
    waiting = (path.relative_to(next_of(folder)).as_posix() for path in (next_of(folder) / INDEX).glob("*.manifest"))
    yield from (index for stem in _stems(waiting) if (index := published(next_of(folder), stem)))


def listed_files(manifest: Manifest) -> list[str]:
    """Every file of a whole dataset but SHA256SUMS, relative, sorted."""
    return [name for name in files_of(shard.name for shard in manifest.shards) if name != SUMS]


def sums_of(known: Mapping[str, str], manifest: Manifest) -> bytes:
    """SHA256SUMS of a dataset whose files have the `known` SHA-256."""
    return "".join(f"{known[name]}  {name}\n" for name in listed_files(manifest)).encode()


def sums_in(data: bytes) -> list[tuple[str, str] | None]:
    """File name and SHA-256 of each line of SHA256SUMS; None for a line that is something else."""
    lines = data.decode(errors="replace").splitlines()
    return [(match[2], match[1]) if (match := _SUM.fullmatch(line)) else None for line in lines]


def _stems(files: Iterable[str]) -> list[str]:
    return sorted(Path(name).stem for name in files if name.startswith(f"{INDEX}/") and name.endswith(".manifest"))


def _roots(folder: Path, manifest: Manifest) -> dict[str, Path]:
    """Where the whole file of each shard is: below `.build/next`, or in its place. A damaged one that waits is dropped,
    so that it does not take the place of a whole one."""
    roots, missing = dict[str, Path](), []
    for shard in manifest.shards:
        found = [root for root in (next_of(folder), folder)
                 if (index := published(root, shard.stem)) and index.shard == shard]
        if not found:
            missing.append(shard.name)
            continue
        roots[shard.stem] = found[0]
        if found[0] == folder:
            with output_errors(folder):
                for path in (index_path(next_of(folder), shard.stem), shard_path(next_of(folder), shard.stem)):
                    path.unlink(missing_ok=True)
    if missing:
        rule, hint = "expected a finished shard", "run the build again"
        raise ShardError(Problem(where=str(folder), path=name, rule=rule, hint=hint) for name in missing)
    return roots
