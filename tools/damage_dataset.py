"""Damage a copy of a dataset in every way and say what notices: `python tools/damage_dataset.py DIR`.

Prints a table: how often each kind of damage was tried, how often each depth of `verify` saw it, and how many of a
sample `repair` mended, from the original, to the same bytes. Where sums were renewed after the damage, as by a faulty
writer, there is nothing to mend it from. The original is only read. Exit code 1 where the deepest look missed anything,
or a repair failed.
"""

import argparse
import random
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from dataset_builder.digest import pixel_digest, sha256_bytes, sha256_file
from dataset_builder.errors import ShardError
from dataset_builder.remote.place import FolderPlace
from dataset_builder.shards import exr
from dataset_builder.shards.folder import CARD, CROISSANT, MANIFEST, SUMS, WORK
from dataset_builder.shards.publish import listed_files, sums_of
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.segment import BLOCK
from dataset_builder.shards.shard_index import MemberRecord, ShardRecord
from dataset_builder.shards.structure import members_of, read_member
from dataset_builder.shards.verify import verify
from dataset_builder.shards.verify_shard import Depth
from dataset_builder.shards.writer import index_path, shard_path
from dataset_builder.transfer.refetch import repair_from
from tools.flip_dataset import flip, index_of, payloads

DEPTHS: tuple[Depth, ...] = ("size", "shard", "member", "pixels")
FIELDS = {"name": 100, "mode": 8, "uid": 8, "gid": 8, "size": 12, "mtime": 12, "chksum": 8, "typeflag": 1,
          "linkname": 100, "magic": 6, "version": 2, "uname": 32, "gname": 32, "devmajor": 8, "devminor": 8,
          "prefix": 155, "rest": 12}
"""Bytes of the fields of a USTAR header, in order."""
PAYLOADS, SMALL, MENDED = 1000, 50, 5
"""Flips in payloads and in each file of text, and repairs that are tried of each kind."""
LAST = 16
"""Bytes at the end of a layer that are pixels, however small it is."""
RENEWED = "renewed"
Damage = Callable[[], object]


@dataclass(frozen=True, kw_only=True)
class Row:
    """What came of one kind of damage."""

    kind: str
    tried: int
    seen: dict[Depth, int]
    """How often by each depth."""
    repairs: int
    mended: int


def damage_dataset(folder: Path, *, payload: int = PAYLOADS, small: int = SMALL, step: int = 1,
                   seed: int = 0) -> Iterator[Row]:
    """A row for every kind of damage to the dataset in `folder`; step: one of so many cuts and header fields."""
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / "copy"
        shutil.copytree(folder, copy, ignore=shutil.ignore_patterns(WORK))
        before = _contents(copy)
        for kind, damages in _kinds(copy, payload, small, step, random.Random(seed)).items():
            seen, mended, repairs = dict.fromkeys(DEPTHS, 0), 0, 0
            for number, damage in enumerate(damages):
                with _undone(copy, before):
                    damage()
                    for depth in DEPTHS:
                        seen[depth] += bool(verify(copy, depth=depth))
                    if RENEWED not in kind and number % max(len(damages) // MENDED, 1) == 0:
                        repairs += 1
                        repair_from(copy, FolderPlace(folder))
                        mended += _contents(copy) == before
            yield Row(kind=kind, tried=len(damages), seen=seen, repairs=repairs, mended=mended)


def _kinds(copy: Path, payload: int, small: int, step: int, chance: random.Random) -> dict[str, list[Damage]]:
    manifest = load_manifest(copy)
    tars = [shard_path(copy, shard.stem) for shard in manifest.shards]
    indexes = [index_path(copy, shard.stem) for shard in manifest.shards]
    first, sizes = tars[0], dict[int, list[Path]]()
    for tar in tars:
        sizes.setdefault(tar.stat().st_size, []).append(tar)
    alike = next((pair for pair in sizes.values() if len(pair) > 1), tars)[:2]
    whole = first.read_bytes()
    stretches = payloads(copy, manifest)
    weights = [size for _, _, size in stretches]

    def flips(places: Sequence[tuple[Path, int, int]]) -> list[Damage]:
        return [partial(flip, path, start + chance.randrange(size), chance.randrange(8))
                for path, start, size in places]

    def text(*paths: Path) -> list[Damage]:
        return flips([(path, 0, path.stat().st_size) for path in (chance.choice(paths) for _ in range(small))])

    return {
        "a shard cut at a multiple of 512 bytes": [partial(first.write_bytes, whole[:size])
                                                   for size in range(0, len(whole), BLOCK * step)],
        "a bit of a field of a tar header": flips(_header_fields(copy)[::step]),
        "a bit of a payload": flips(chance.choices(stretches, weights=weights, k=payload)),
        "a bit of the padding or the end": flips(_fill(copy)[::step]),
        "a bit of a payload, the sums renewed": [
            partial(_flip_and_renew, copy, chance.choice(manifest.shards), chance, index=False) for _ in range(small)],
        "a bit of pixels, the sums and the index renewed": [
            partial(_flip_and_renew, copy, chance.choice(manifest.shards), chance, index=True) for _ in range(small)],
        "a bit of an index": text(*indexes),
        "a bit of dataset.json": text(copy / MANIFEST),
        "a bit of SHA256SUMS": text(copy / SUMS),
        "a bit of the card or the catalogue": text(copy / CARD, copy / CROISSANT),
        "a shard missing": [tar.unlink for tar in tars],
        "an index missing": [path.unlink for path in indexes],
        "another file missing": [(copy / name).unlink for name in (MANIFEST, SUMS, CARD, CROISSANT)],
        "a shard twice, under another name": [partial(shutil.copy, tar, tar.with_name("twice.tar")) for tar in tars],
        "a shard renamed": [partial(tar.rename, tar.with_name("another.tar")) for tar in tars],
        "a shard in place of another": [partial(shutil.copy, one, other) for one in tars for other in tars
                                        if one != other],
        "two shards of one size swapped": [partial(_swap, *alike)],
        "two indexes swapped": [partial(_swap, *indexes[:2])],
        "a file too many": [partial((copy / name).write_text, "x") for name in ("notes.txt", "index/more.manifest")],
    }


def _header_fields(copy: Path) -> list[tuple[Path, int, int]]:
    """Every field of the header of every member."""
    found = []
    for shard in load_manifest(copy).shards:
        for member in members_of(index_of(copy, shard.stem)):
            at = member.offset - BLOCK
            for size in FIELDS.values():
                found.append((shard_path(copy, shard.stem), at, size))
                at += size
    return found


def _fill(copy: Path) -> list[tuple[Path, int, int]]:
    """What follows each payload."""
    return [(shard_path(copy, shard.stem), member.offset + member.size, -member.size % BLOCK or BLOCK)
            for shard in load_manifest(copy).shards for member in members_of(index_of(copy, shard.stem))
            if member.size % BLOCK]


def _flip_and_renew(copy: Path, shard: ShardRecord, chance: random.Random, *, index: bool) -> None:
    """Flip a bit in the last bytes of a layer, which are pixels, and let every hash of the shard follow, with `index`
    that of the layer as well: what a faulty writer leaves."""
    member = chance.choice([one for one in members_of(index_of(copy, shard.stem)) if one.name.endswith(".exr")])
    tar = shard_path(copy, shard.stem)
    pixels = _decoded(tar, member)
    while _decoded(tar, member) == pixels:
        # A few bits at the end of compressed data mean nothing
        flip(tar, member.offset + member.size - 1 - chance.randrange(LAST), chance.randrange(8))
    new = {shard.sha256: sha256_file(tar)}
    if index:
        new[member.sha256] = sha256_bytes(tar.read_bytes()[member.offset:member.offset + member.size])
    for path in (copy / MANIFEST, copy / CROISSANT, index_path(copy, shard.stem)):
        text = path.read_text()
        for old, value in new.items():
            text = text.replace(old, value)
        path.write_text(text)
    manifest = load_manifest(copy)
    known = {name: sha256_file(copy / name) for name in listed_files(manifest)}
    (copy / SUMS).write_bytes(sums_of(known, manifest))


def _decoded(tar: Path, member: MemberRecord) -> str:
    """Digest of a layer's pixels; empty where they do not decode."""
    try:
        return pixel_digest(exr.read(read_member(tar, member), where=member.name).pixels)
    except ShardError:
        return ""


def _swap(one: Path, other: Path) -> None:
    data = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(data)


@contextmanager
def _undone(copy: Path, before: dict[str, bytes]) -> Iterator[None]:
    """Undo whatever was done to a copy, afterwards."""
    yield
    now = _contents(copy)
    for name in now.keys() - before.keys():
        (copy / name).unlink()
    for name, data in before.items():
        if now.get(name) != data:
            (copy / name).write_bytes(data)
    shutil.rmtree(copy / WORK, ignore_errors=True)


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*")
            if path.is_file() and WORK not in path.relative_to(folder).parts}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 where anything was missed or not mended."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--payload", type=int, default=PAYLOADS, help="flips in payloads (default: %(default)s)")
    parser.add_argument("--small", type=int, default=SMALL, help="flips in each file of text (default: %(default)s)")
    parser.add_argument("--step", type=int, default=1, help="one of so many cuts and header fields (default: all)")
    options = parser.parse_args(arguments)
    print(f"| damage | tried | {' | '.join(DEPTHS)} | mended |\n|{' --- |' * (len(DEPTHS) + 3)}")
    wrong = False
    for row in damage_dataset(options.folder, payload=options.payload, small=options.small, step=options.step):
        seen = " | ".join(str(row.seen[depth]) for depth in DEPTHS)
        print(f"| {row.kind} | {row.tried} | {seen} | {row.mended} of {row.repairs} |", flush=True)
        wrong |= row.seen["pixels"] < row.tried or row.mended < row.repairs
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
