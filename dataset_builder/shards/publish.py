"""The files around the shards: card, Croissant, checksums, and `dataset.json` last, which makes the dataset whole."""

import re
from pathlib import Path

from dataset_builder.digest import sha256_bytes, sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.files import write_atomic
from dataset_builder.shards.card import card
from dataset_builder.shards.croissant import croissant
from dataset_builder.shards.folder import MANIFEST, retract
from dataset_builder.shards.manifest import Manifest, to_json
from dataset_builder.shards.writer import index_path, published, shard_path

CARD, CROISSANT, SUMS = "README.md", "croissant.json", "SHA256SUMS"
_SUM = re.compile(r"([0-9a-f]{64})  (\S.*)")


def publish_dataset(folder: Path, manifest: Manifest) -> None:
    """Write everything but the shards; `dataset.json` appears last, by one rename.

    Raises ShardError where a shard that the manifest lists is not done, OutputError where the disk refuses.
    """
    _require_shards(folder, manifest)
    retract(folder)
    texts = {CARD: card(manifest).encode(), CROISSANT: croissant(manifest).encode(), MANIFEST: to_json(manifest)}
    for name in (CARD, CROISSANT):
        write_atomic(folder / name, texts[name])
    write_atomic(folder / SUMS, _sums(folder, manifest, texts))
    write_atomic(folder / MANIFEST, texts[MANIFEST])


def listed_files(manifest: Manifest) -> list[str]:
    """Every file of a whole dataset but SHA256SUMS, relative, sorted."""
    shards = [path for shard in manifest.shards
              for path in (shard_path(Path(), shard.stem), index_path(Path(), shard.stem))]
    return sorted([*(path.as_posix() for path in shards), CARD, CROISSANT, MANIFEST])


def sums_in(data: bytes) -> list[tuple[str, str] | None]:
    """File name and SHA-256 of each line of SHA256SUMS; None for a line that is something else."""
    lines = data.decode(errors="replace").splitlines()
    return [(match[2], match[1]) if (match := _SUM.fullmatch(line)) else None for line in lines]


def _sums(folder: Path, manifest: Manifest, texts: dict[str, bytes]) -> bytes:
    known = {shard_path(Path(), shard.stem).as_posix(): shard.sha256 for shard in manifest.shards}
    known |= {name: sha256_bytes(data) for name, data in texts.items()}
    lines = [f"{known.get(name) or sha256_file(folder / name)}  {name}\n" for name in listed_files(manifest)]
    return "".join(lines).encode()


def _require_shards(folder: Path, manifest: Manifest) -> None:
    missing = [shard.name for shard in manifest.shards
               if (index := published(folder, shard.stem)) is None or index.shard != shard]
    if missing:
        rule, hint = "expected a finished shard", "run the build again"
        raise ShardError(Problem(where=str(folder), path=name, rule=rule, hint=hint) for name in missing)
