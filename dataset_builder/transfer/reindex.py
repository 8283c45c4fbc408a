"""The index of a shard that is whole, from the shard: all that it says but its digests of plans, which specs give."""

import tarfile
from collections.abc import Mapping
from pathlib import Path

from dataset_builder.digest import pixel_digest, sha256_bytes, sha256_file
from dataset_builder.engine.made_by import plan_digest
from dataset_builder.errors import ShardError
from dataset_builder.shards import exr
from dataset_builder.shards.example import LABEL, PREVIEW, decode_png
from dataset_builder.shards.label_text import parse_label
from dataset_builder.shards.manifest import to_json
from dataset_builder.shards.shard_index import (
    ExampleFacts,
    ExampleRecord,
    MemberRecord,
    ShardIndex,
    ShardRecord,
    tagged,
)
from dataset_builder.shards.writer import writer_versions
from dataset_builder.spec.dataset import DatasetSpec


def reindexed(tar: Path, spec: DatasetSpec, made_by: dict[str, str], digests: Mapping[str, str]) -> bytes | None:
    """The index of the whole shard `tar`; None where what comes out does not fit the tag in the shard's name. digests:
    of what the examples of each split depend on."""
    examples, splits = list[ExampleRecord](), list[str]()
    try:
        for key, files in _examples(tar).items():
            label = parse_label(files[f"{key}.{LABEL}"][1], where=tar.name, name=f"{key}.{LABEL}")
            splits.append(label.split)
            own = {name.partition(".")[2]: _record(name, *place) for name, place in files.items()}
            # Stored once, the rest lies with an earlier example of the view; the tag tells where it does not
            shared = {record.suffix: record for one in reversed(examples) if one.view == label.plan.view
                      for record in one.members}
            examples.append(ExampleRecord(
                key=key, view=label.plan.view, facts=ExampleFacts.of(label.plan),
                digest=plan_digest(label.plan, spec, made_by, label.record.denoised),
                members=tuple(record for _, record in sorted({**shared, **own}.items()))))
        shard = ShardRecord(name=tar.name, split=splits[0], bytes=tar.stat().st_size, sha256=sha256_file(tar),
                            examples=len(examples), first_key=examples[0].key, last_key=examples[-1].key)
        index = tagged(ShardIndex(shard=shard, spec_digest=digests[splits[0]], examples=tuple(examples),
                                  versions={**writer_versions(), **made_by}), shard.slot)
    except (ShardError, OSError, ValueError, LookupError, tarfile.TarError):
        return None
    return to_json(index) if index.shard == shard else None


def _examples(tar: Path) -> dict[str, dict[str, tuple[int, bytes]]]:
    """Of every key the files in the shard: where each begins, and its bytes."""
    found = dict[str, dict[str, tuple[int, bytes]]]()
    with tarfile.open(tar, "r:") as stream:
        for info in stream:
            file = stream.extractfile(info)
            data = file.read() if file else b""
            found.setdefault(info.name.partition(".")[0], {})[info.name] = info.offset_data, data
    return found


def _record(name: str, offset: int, data: bytes) -> MemberRecord:
    pixels = None
    if name.endswith(".exr"):
        pixels = exr.read(data, where=name).pixels
    elif name.endswith(PREVIEW):
        pixels = decode_png(data, where=name)
    return MemberRecord(name=name, offset=offset, size=len(data), sha256=sha256_bytes(data),
                        pixel_digest="" if pixels is None else pixel_digest(pixels))
