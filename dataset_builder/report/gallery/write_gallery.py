"""The gallery of a dataset: a folder, or one file with everything inside. One example is in memory at a time."""

from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

from dataset_builder.digest import CHUNK_BYTES
from dataset_builder.errors import OutputError, Problem, UserError, count_of
from dataset_builder.files import commit, output_errors, require_space, require_writable, size_text, write_partial
from dataset_builder.report.front.fill_page import script_json
from dataset_builder.report.front.pages import gallery_page
from dataset_builder.report.gallery.example_payload import Payload, example_payload
from dataset_builder.report.gallery.gallery_entries import (
    Plain,
    about,
    entry,
    rejected_entry,
    rejected_in,
    rejected_layers,
    seconds_by_key,
    thumbnail,
)
from dataset_builder.report.gallery.gallery_folder import EXAMPLES, PAGE, THUMBS, renewed_folder
from dataset_builder.report.gallery.shown_examples import Keys, chosen, estimated_bytes
from dataset_builder.shards.reader import Dataset, open_dataset

MOST = 300 * 2**20
"""Bytes of a page with everything inside; browsers become slow, and then refuse."""
HERE = "<!--payloads-->"
"""Where a page has its payloads, once they are there."""

Follow = Callable[[Sequence[str]], Iterable[str]]
Keep = Callable[[str, Payload, bytes], str]
"""Takes key, payload and thumbnail (bytes of a JPEG, or none); where the thumbnail is found."""


@dataclass(frozen=True, kw_only=True)
class GalleryJob:
    """What to show, and where."""

    dataset: Path | str
    """Folder or address of a finished dataset."""
    out: Path
    """A file whose name ends in `.html`, or a folder."""
    count: int | None = None
    """Examples, spread over the splits; all without."""
    splits: Sequence[str] = ()
    """Names; all without."""
    layers: Sequence[str] = ()
    """Names; all without."""

    @property
    def inside(self) -> bool:
        """Whether everything goes into one file."""
        return self.out.suffix.lower() == ".html"


@dataclass(frozen=True)
class GalleryDone:
    """What was written. page: what to open in a browser."""

    page: Path
    examples: int
    bytes: int


def write_gallery(job: GalleryJob, follow: Follow = list) -> GalleryDone:
    """Write the gallery, whole or not at all; equal datasets, with equal `seconds.csv`, give equal bytes.

    follow: passes the keys of examples on while it shows how many are done. Raises UserError for splits and layers
    that there are not, and where one file would be too large; ShardError where the dataset is damaged; OutputError
    where the place holds something else, lies in the dataset, or cannot be written.
    """
    _require_outside(job)
    dataset = open_dataset(job.dataset, layers=job.layers or None)
    splits = chosen(dataset, job.splits, job.count)
    keys = [key for own in splits.values() for key in own]
    size = estimated_bytes(dataset, splits)
    if job.inside and size > MOST:
        raise _too_large(job, dataset, splits, size)
    require_space(job.out, 2 * size if job.inside else size)

    def page(keep: Keep, base: str) -> str:
        entries = list(_examples(dataset, follow(keys), seconds_by_key(job.dataset), keep))
        rejected = list(_rejected(dataset, list(splits), keep))
        shown = {name: len(own) for name, own in splits.items()}
        gallery = {"title": f"{dataset.manifest.title} {dataset.manifest.version}",
                   "about": about(dataset.manifest, dataset.layers, shown),
                   "layers": list(dataset.layers), "examples": entries, "rejected": rejected, "base": base}
        return gallery_page(gallery, HERE)

    written = (_in_a_file if job.inside else _in_a_folder)(job.out, page)
    return GalleryDone(job.out if job.inside else job.out / PAGE, len(keys), written)


def _in_a_folder(out: Path, page: Callable[[Keep, str], str]) -> int:
    written = 0

    def keep(key: str, payload: Payload, thumb: bytes) -> str:
        nonlocal written
        script = f"galleryExample({script_json(payload)});\n".encode()
        (folder / EXAMPLES / f"{key}.js").write_bytes(script)
        written += len(script) + len(thumb)
        if thumb:
            (folder / THUMBS / f"{key}.jpg").write_bytes(thumb)
        return f"{THUMBS}/{key}.jpg"

    with renewed_folder(out) as folder:
        (folder / EXAMPLES).mkdir()
        (folder / THUMBS).mkdir()
        text = page(keep, f"{EXAMPLES}/").replace(HERE, "").encode()
        (folder / PAGE).write_bytes(text)
        return written + len(text)


def _in_a_file(out: Path, page: Callable[[Keep, str], str]) -> int:
    # Payloads come before the page is known: they wait in a file without a name
    require_writable(out.parent)
    with output_errors(out), TemporaryFile(dir=out.parent) as waiting:
        def keep(key: str, payload: Payload, thumb: bytes) -> str:
            element = f'<script type="application/json" data-key="{key}">{script_json(payload)}</script>\n'
            waiting.write(element.encode())
            return f"data:image/jpeg;base64,{b64encode(thumb).decode()}"

        head, tail = page(keep, "").split(HERE)
        size, _ = write_partial(out, chain([head.encode()], _read(waiting), [tail.encode()]))
        commit(out)
    return size


def _read(stream: BinaryIO) -> Iterator[bytes]:
    stream.seek(0)
    while chunk := stream.read(CHUNK_BYTES):
        yield chunk


def _examples(dataset: Dataset, keys: Iterable[str], seconds: Mapping[str, float], keep: Keep) -> Iterator[Plain]:
    for key in keys:
        example = dataset[key]
        label = example["meta"]
        title = f"{label['plan']['target']['object']['name']} in {label['plan']['room']['name']}"
        found = keep(key, example_payload(example, title=title), thumbnail(example))
        yield entry(label, dataset.layers, seconds.get(key), found)


def _rejected(dataset: Dataset, splits: Sequence[str], keep: Keep) -> Iterator[Plain]:
    for item, path in rejected_in(dataset, splits):
        layers = rejected_layers(path, dataset.layers) if path else {}
        if layers:
            keep(item.key, example_payload(layers, key=item.key, title="Rejected example",
                                           note=f"{item.gate}: {item.reason}"), b"")
        yield rejected_entry(item, bool(layers))


def _require_outside(job: GalleryJob) -> None:
    """Raise OutputError where the gallery would lie in the dataset, whose files builds and checks know one by one."""
    if isinstance(job.dataset, Path) and job.out.resolve().is_relative_to(job.dataset.resolve()):
        problem = Problem(where=str(job.out), path="", rule="expected a place outside the dataset",
                          hint="a build would refuse the folder for a file that is not its own")
        raise OutputError([problem])


def _too_large(job: GalleryJob, dataset: Dataset, splits: Keys, size: int) -> UserError:
    count = sum(map(len, splits.values()))
    rule = (f"expected a file of at most {size_text(MOST)}, got about {size_text(size)}: {count:,} examples with "
            f"{count_of(len(dataset.layers), 'layer')}")
    hint = (f"say --count {max(1, count * MOST // size)}, --layers {','.join(dataset.layers[:2])} or --split "
            f"{next(iter(splits))}, or name a folder, which may be of any size")
    return UserError([Problem(where=str(job.out), path="", rule=rule, hint=hint)])
