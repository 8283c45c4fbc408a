"""Flip bits of a dataset and count what goes unnoticed: `python tools/flip_dataset.py DIR`.

One random bit at a time in a copy: in `dataset.json`, in indexes, in layers and labels of examples, and in what a build
keeps of a finished example until its shard is written. Whatever `verify`, the reader as it is by default, or a resumed
build takes without an error is silent. The original is only read. Exit code 1 where anything was silent.
"""

import argparse
import random
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.errors import ShardError
from dataset_builder.shards.example import PREVIEW
from dataset_builder.shards.folder import MANIFEST, STAGING, WORK
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.structure import members_of
from dataset_builder.shards.verify import verify
from dataset_builder.shards.writer import index_path, shard_path

COUNTS = {"manifest": 300, "index": 300, "payload": 500, "seal": 4000}
"""Flips of each kind."""
Bytes = tuple[Path, int, int]
"""A stretch of a file: first byte and how many."""


@dataclass(frozen=True, kw_only=True)
class Count:
    """Flips of one kind that one check noticed, and places (`file:byte:bit`) of those that it did not."""

    kind: str
    check: str
    caught: int
    silent: tuple[str, ...]


def flip_dataset(folder: Path, counts: dict[str, int], *, seed: int = 0) -> list[Count]:
    """Counts for the dataset in `folder`, which stays as it is. Raises ShardError where that is damaged already."""
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / "copy"
        shutil.copytree(folder, copy)
        manifest = load_manifest(copy)
        for kind, stretches, checks in (
            ("manifest", [(copy / MANIFEST, 0, (copy / MANIFEST).stat().st_size)], CHECKS),
            ("index", [_whole(index_path(copy, shard.stem)) for shard in manifest.shards], CHECKS),
            ("payload", payloads(copy, manifest), CHECKS),
            ("seal", _staged(copy, manifest), {"staging": lambda at: _is_staged(at, *_first(copy, manifest)[:2])}),
        ):
            found += _flipped(kind, copy, stretches, checks, counts.get(kind, 0), random.Random(f"{seed} {kind}"))
    return found


def _noticed_by_verify(folder: Path) -> bool:
    return bool(verify(folder))


def _noticed_by_reader(folder: Path) -> bool:
    try:
        for _ in open_dataset(folder):
            pass
    except ShardError:
        return True
    return False


CHECKS: dict[str, Callable[[Path], bool]] = {"verify": _noticed_by_verify, "reader": _noticed_by_reader}


def _flipped(kind: str, folder: Path, stretches: Sequence[Bytes], checks: dict[str, Callable[[Path], bool]], count: int,
             chance: random.Random) -> list[Count]:
    caught, silent = dict.fromkeys(checks, 0), {name: list[str]() for name in checks}
    for _ in range(count):
        path, first, size = chance.choices(stretches, weights=[size for _, _, size in stretches])[0]
        byte, bit = first + chance.randrange(size), chance.randrange(8)
        flip(path, byte, bit)
        for name, check in checks.items():
            if check(folder):
                caught[name] += 1
            else:
                silent[name].append(f"{path.relative_to(folder)}:{byte}:{bit}")
        flip(path, byte, bit)
    return [Count(kind=kind, check=name, caught=caught[name], silent=tuple(silent[name])) for name in checks]


def flip(path: Path, byte: int, bit: int) -> None:
    with path.open("r+b") as stream:
        stream.seek(byte)
        value = stream.read(1)[0] ^ 1 << bit
        stream.seek(byte)
        stream.write(bytes([value]))


def _whole(path: Path) -> Bytes:
    return path, 0, path.stat().st_size


def payloads(folder: Path, manifest: Manifest) -> list[Bytes]:
    """What readers read: layers and labels, not previews."""
    return [(shard_path(folder, shard.stem), member.offset, member.size) for shard in manifest.shards
            for member in members_of(index_of(folder, shard.stem)) if not member.name.endswith(PREVIEW)]


def index_of(folder: Path, stem: str) -> ShardIndex:
    return from_json(ShardIndex, index_path(folder, stem).read_bytes(), where=stem)


def _staged(folder: Path, manifest: Manifest) -> list[Bytes]:
    """The two files of the first example, staged again."""
    key, digest, segment, entry = _first(folder, manifest)
    Staging(folder).put(key, digest, segment, entry)
    return [_whole(path) for path in (folder / WORK / STAGING).iterdir() if path.suffix == ".json"]


def _first(folder: Path, manifest: Manifest) -> tuple[str, str, bytes, dict[str, object]]:
    stem = manifest.shards[0].stem
    example = index_of(folder, stem).examples[0]
    last = example.members[-1]
    with shard_path(folder, stem).open("rb") as stream:
        segment = stream.read(last.offset + last.size + -last.size % 512)
    members = [member.model_dump(exclude={"offset"}) for member in example.members]
    return example.key, example.digest, segment, {"key": example.key, "view": example.view, "members": members}


def _is_staged(folder: Path, key: str, digest: str) -> bool:
    return not Staging(folder).has(key, digest)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line per kind and check; 1 where anything was silent."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    for kind, count in COUNTS.items():
        parser.add_argument(f"--{kind}", type=int, default=count, metavar="N", help=f"flips (default: {count})")
    options = parser.parse_args(arguments)
    found = flip_dataset(options.folder, {kind: getattr(options, kind) for kind in COUNTS})
    for one in found:
        print(f"{one.kind}, {one.check}: {one.caught} caught, {len(one.silent)} silent", *one.silent[:5])
    return 1 if any(one.silent for one in found) else 0


if __name__ == "__main__":
    sys.exit(main())
