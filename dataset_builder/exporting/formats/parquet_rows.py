"""Apache Parquet: a row for each example, `data/SPLIT-NNNNN-of-NNNNN.parquet`, as Hugging Face's hub lays it out.

Layers are columns of EXR files: readers fetch the columns that they ask for and no others, and the files are a quarter
to a half of the same pixels as numbers. What examples are chosen by has columns of its own, for queries.
"""

import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dataset_builder.errors import Problem, ShardError, UserError
from dataset_builder.exporting.formats.source_shard import ExportFile, SourceRow, SourceShard, write_file
from dataset_builder.shards.example import PREVIEW
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.shard_index import ExampleFacts

if TYPE_CHECKING:
    import pyarrow

GROUP_BYTES = 1 << 25
"""Files that a group of rows holds at most, unless one row alone has more: readers take in a group at a time."""
KEY, LABEL, LOOK = "key", "label", "preview"
TEXTS = (KEY, "object", "category", "scene", "level_name")
NUMBERS = ("light", "level")


def require_pyarrow() -> None:
    """Raise UserError with what to install where pyarrow is not there."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ModuleNotFoundError as error:
        raise UserError("expected the package pyarrow, which is not installed; pip install pyarrow") from error


def write_shard(shard: SourceShard, out: Path) -> Iterator[ExportFile]:
    """The file of one shard, read back for keys and counts before it has its name."""
    name = f"data/{shard.split}-{shard.number:05d}-of-{shard.count:05d}.parquet"
    keys = [example.key for example in shard.index.examples]
    yield write_file(out, name, _chunks(shard), examples=len(keys), check=lambda path: _check(path, keys))


def write_card(out: Path, manifest: Manifest, splits: Sequence[str]) -> ExportFile:
    """`README.md`: where the hub and `load_dataset` look for splits, and the licence."""
    licence = json.dumps(manifest.licence.lower(), ensure_ascii=False)
    lines = "\n".join(f"  - split: {json.dumps(split)}\n    path: {json.dumps(f'data/{split}-*.parquet')}"
                      for split in splits)
    own = manifest.licence.lower().startswith("licenseref-")
    text = f"""---
{f"license: other{chr(10)}license_name: {licence}" if own else f"license: {licence}"}
pretty_name: {json.dumps(manifest.title, ensure_ascii=False)}
tags: [openexr, synthetic]
task_categories: [image-to-image]
configs:
- config_name: default
  data_files:
{lines}
---

Version {manifest.version} of `{manifest.name}` as Parquet: a row for each example. Columns of layers, such as `i_t`,
are OpenEXR files; `label` is JSON, `preview` a picture to look at. `export.json` has what each layer is, sources,
licences, and the SHA-256 of every file.
"""
    return write_file(out, "README.md", [text.encode()], examples=0)


class _Sink(io.RawIOBase):
    """A file that hands over what was written to it since the last time."""

    def __init__(self) -> None:
        super().__init__()
        self._parts, self._size = list[bytes](), 0

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self._parts.append(bytes(data))
        self._size += len(self._parts[-1])
        return len(self._parts[-1])

    def tell(self) -> int:
        return self._size

    def taken(self) -> bytes:
        """What is new."""
        data, self._parts = b"".join(self._parts), []
        return data


def _chunks(shard: SourceShard) -> Iterator[bytes]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    previews = all(PREVIEW in shard.members(example) for example in shard.index.examples)
    schema, sink = _schema(shard.layers, previews), _Sink()
    # EXR and PNG files are compressed, and no two are equal
    plain = [*shard.layers, *[LOOK] * previews, f"{LOOK}.bytes"]
    with pq.ParquetWriter(pa.PythonFile(sink, "w"), schema, compression={
            **dict.fromkeys((*TEXTS, *NUMBERS, LABEL), "zstd"), **dict.fromkeys(plain, "none")},
            use_dictionary=[*TEXTS, *NUMBERS], write_statistics=[*TEXTS, *NUMBERS], write_page_checksum=True) as writer:
        for group in _groups(shard):
            writer.write_table(pa.Table.from_pylist([_values(row, previews) for row in group], schema=schema))
            yield sink.taken()
    yield sink.taken()


def _schema(layers: Sequence[str], previews: bool) -> "pyarrow.Schema":
    """With what Hugging Face's library makes of a column, where that is not plain: `preview` is a picture."""
    import pyarrow as pa

    kinds = {**dict.fromkeys(TEXTS, (pa.string(), "string")), **dict.fromkeys(NUMBERS, (pa.int64(), "int64")),
             **dict.fromkeys(layers, (pa.binary(), "binary")), LABEL: (pa.string(), "string")}
    features = {name: {"dtype": kind, "_type": "Value"} for name, (_, kind) in kinds.items()}
    fields = [pa.field(name, kind, nullable=False) for name, (kind, _) in kinds.items()]
    if previews:
        features[LOOK] = {"_type": "Image"}
        fields.append(pa.field(LOOK, pa.struct({"bytes": pa.binary(), "path": pa.string()})))
    return pa.schema(fields, metadata={"huggingface": json.dumps({"info": {"features": features}})})


def _groups(shard: SourceShard) -> Iterator[list[SourceRow]]:
    group, size = list[SourceRow](), 0
    for row in shard.rows():
        more = len(row.label) + len(row.preview) + sum(map(len, row.layers.values()))
        if group and size + more > GROUP_BYTES:
            yield group
            group, size = [], 0
        group.append(row)
        size += more
    yield group


def _values(row: SourceRow, previews: bool) -> dict[str, Any]:
    facts: ExampleFacts = row.example.facts
    look = {LOOK: {"bytes": row.preview, "path": f"{row.example.key}.png"}} if previews else {}
    return {KEY: row.example.key, **facts.model_dump(), **row.layers, LABEL: row.label.decode(), **look}


def _check(path: Path, keys: list[str]) -> None:
    import pyarrow.parquet as pq

    found = pq.read_table(path, columns=[KEY], page_checksum_verification=True)[KEY].to_pylist()
    if found != keys:
        raise ShardError([Problem(where=path.name, path="", rule=f"expected to read back {len(keys)} keys as they were "
                                  f"written, got {len(found)}")])
