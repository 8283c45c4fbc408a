"""What a gallery says of a dataset, of each example and of what was rejected, as plain data; and its thumbnails."""

import csv
import re
import struct
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.assets.field_file import UNREADABLE
from dataset_builder.engine.rejected_pixels import pixels_of
from dataset_builder.errors import Problem, ShardError
from dataset_builder.remote.open_place import place_of
from dataset_builder.report.gallery.example_payload import layer_facts, look, relative_errors, trust
from dataset_builder.shards.folder import MOST_BYTES, SECONDS
from dataset_builder.shards.manifest import Manifest, Rejected
from dataset_builder.shards.reader import Dataset
from dataset_builder.tonemap import exposure, to_8bit

Plain = dict[str, Any]
KEY = re.compile("[0-9]{8}")
THUMB = 160
"""Most pixels along a side of a thumbnail."""
QUALITY = 85
"""Of its JPEG."""
SHOWN = ("i_t", "s", "i_s", "s_prime")
"""Layers that a thumbnail may show, the best first."""


def about(manifest: Manifest, layers: Sequence[str], shown: Mapping[str, int]) -> Plain:
    """What is said of the dataset. shown: how many examples the gallery has, by split."""
    there = {split.name: split.examples for split in manifest.splits}
    return {
        "name": manifest.name, "version": manifest.version, "description": manifest.description,
        "licence": manifest.licence, "creator": manifest.creator, "url": manifest.url,
        "width": manifest.width, "height": manifest.height,
        "examples": manifest.totals.examples,
        "splits": {name: {"shown": count, "examples": there[name]} for name, count in shown.items()},
        "layers": {layer.name: {**layer_facts(layer.name), "extent": layer.extent, "stored": layer.dtype}
                   for layer in manifest.layers if layer.name in layers},
        "denoised": {entry.layer: trust(entry.model_dump()) for entry in manifest.denoised if entry.layer in layers},
        "generator": manifest.generator, "spec_digest": manifest.spec_digest,
    }


def entry(label: Mapping[str, Any], layers: Sequence[str], seconds: float | None, thumb: str) -> Plain:
    """What the grid says of an example. layers: those whose errors are told."""
    plan, record = label["plan"], label["record"]
    rough = plan["rough"]
    return {
        "key": label["key"], "split": label["split"], "scene": plan["room"]["name"],
        "object": plan["target"]["object"]["name"], "category": plan["target"]["object"]["category"],
        "light": plan["light"], "lights": " + ".join(light["kind"] for light in plan["target_light"]["lights"]),
        "level": rough["level"], "level_name": rough.get("name") or f"level {rough['level']}",
        "noise": record["roughness_rms"], "sigma": rough["sigma"], "seconds": seconds,
        "errors": {name: error for name, error in relative_errors(label).items() if name in layers},
        "thumb": thumb,
    }


def rejected_entry(item: Rejected, pixels: bool) -> Plain:
    """What is said of an example that is not shipped. pixels: whether it can be opened."""
    return {"key": item.key, "view": item.view, "gate": item.gate, "reason": item.reason, "open": pixels}


def rejected_in(dataset: Dataset, splits: Sequence[str]) -> Iterator[tuple[Rejected, Path | None]]:
    """Rejected examples of some splits, and where their layers lie, if they were kept here."""
    for item in dataset.manifest.rejected:
        if item.view.partition("/")[0] in splits:
            # What a manifest calls a rejected example may be anything, a path included
            own = isinstance(dataset.folder, Path) and KEY.fullmatch(item.key)
            yield item, pixels_of(Path(dataset.folder), item.key) if own else None


DAMAGE = (*UNREADABLE, RuntimeError, struct.error)
"""What NumPy and zip files raise for bytes that are no longer theirs, encrypted ones included."""


def rejected_layers(path: Path, layers: Sequence[str]) -> dict[str, np.ndarray]:
    """The layers of a rejected example that are wanted. Raises ShardError where the file is damaged."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            found = {name: file[name] for name in file.files if name in layers}
        if odd := [name for name, image in found.items() if image.ndim != 3 or image.dtype.kind != "f"
                   or image.shape[:2] != next(iter(found.values())).shape[:2]]:
            raise ValueError(f"{odd[0]} is {found[odd[0]].dtype} of {found[odd[0]].shape}")
        return found
    except DAMAGE as error:
        problem = Problem(where=str(path), path="", rule=f"expected layers of a rejected example ({error})",
                          hint="remove the file, or build again")
        raise ShardError([problem]) from error


def thumbnail(example: Mapping[str, Any]) -> bytes:
    """A small JPEG of an example: its target image, or what comes closest, exposed by itself."""
    from PIL import Image

    names = [name for name in example if name != "meta"]
    name = next((name for name in (*SHOWN, *names) if name in names and look(name) != "error"), names[0])
    pixels = example[name]
    picture = Image.fromarray(to_8bit(pixels, exposure([pixels]) if look(name) in ("light", "length") else 1.0))
    picture.thumbnail((THUMB, THUMB), Image.Resampling.BOX)
    stream = BytesIO()
    picture.save(stream, "JPEG", quality=QUALITY, optimize=True)
    return stream.getvalue()


def seconds_by_key(folder: Path | str) -> dict[str, float]:
    """Seconds that examples took, summed over their steps, where a build left them; what several examples of a view
    share counts for the first of them."""
    try:
        text = place_of(folder).read(SECONDS, most=MOST_BYTES).decode()
    except (OSError, UnicodeDecodeError):
        return {}
    found: defaultdict[str, float] = defaultdict(float)
    for row in csv.DictReader(text.splitlines()):
        found[str(row.get("key"))] += _number(row.get("seconds"))
    return {key: round(seconds, 4) for key, seconds in found.items()}


def _number(text: str | None) -> float:
    try:
        return float(text or 0)
    except ValueError:
        return 0.0
