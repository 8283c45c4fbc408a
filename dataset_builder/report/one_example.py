"""One example at full size, as a page for the browser and as a picture: of a dataset, or of what a build staged."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.engine.rejected_pixels import pixels_of
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.layers import LAYERS
from dataset_builder.report.example_sheet import png_of
from dataset_builder.report.front.pages import examples_page
from dataset_builder.report.gallery.example_payload import example_payload
from dataset_builder.report.gallery.gallery_entries import rejected_layers
from dataset_builder.report.layer_tiles import layer_tiles
from dataset_builder.shards.example_key import key_of
from dataset_builder.shards.folder import PREVIEWS
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.reader import open_dataset

DIGITS = 12
"""Of a digest, enough to tell two apart."""


@dataclass(frozen=True, kw_only=True)
class ExampleFiles:
    """Where an example can be looked at."""

    page: Path
    picture: Path | None
    """None where there are no pixels."""


def previews_of(folder: Path | str) -> Path:
    """Where pages and pictures of a dataset go unless said otherwise: in it, or here where it is at an address."""
    return folder / PREVIEWS if isinstance(folder, Path) else Path()


def look_at_example(folder: Path | str, text: str, out: Path | None = None) -> ExampleFiles:
    """Write `KEY.html` and `KEY.png` of an example of a finished dataset, named as `key_of` has it, or of one that was
    rejected, named by its key or index.

    Raises UserError where there is no such example, ShardError as `open_dataset` does, OutputError.
    """
    dataset, out = open_dataset(folder), out or previews_of(folder)
    manifest = dataset.manifest
    about = f"{manifest.title} {manifest.version}, spec {manifest.spec_digest[:DIGITS]}"
    for item in manifest.rejected:
        # What a manifest calls a rejected example may be anything, a path included
        if text.isdecimal() and item.key == text.zfill(len(item.key)):
            return write_rejected(item, folder, out, about=about)
    key = key_of(dataset, text)
    return write_example(dataset[key], key, out, lead=[about])


def write_rejected(item: Rejected, folder: Path | str, out: Path, *, about: str,
                   plan: Mapping[str, Any] | None = None) -> ExampleFiles:
    """The same of an example that failed a gate: which one on top, and the pixels that the build in `folder` kept of
    it, if any. about: what it is of; plan: its own, as JSON, where it is known. Raises OutputError, and ShardError
    where what was kept is damaged."""
    pixels = pixels_of(folder, item.key) if isinstance(folder, Path) else None
    lead = [f"Rejected by the gate {item.gate}: {item.reason}", about]
    if not pixels:
        lead.append("Its pixels were not kept: nothing was rendered, it was made elsewhere, or many were rejected "
                    "before.")
    example = {**(rejected_layers(pixels, [*LAYERS]) if pixels else {}), "meta": {"plan": plan} if plan else {}}
    return write_example(example, item.key, out, lead=lead, note="rejected")


def write_example(example: Mapping[str, Any], key: str, out: Path, *, lead: Sequence[str] = (),
                  note: str = "") -> ExampleFiles:
    """Write the page and the picture of an example, each whole or not at all.

    example: layers by name and the label under `meta`, either of which may lack. lead: lines above all else; note: what
    it is, where it is no finished example. Raises OutputError.
    """
    page, picture = out / f"{key}.html", out / f"{key}.png"
    title = example_title(key, example.get("meta", {}).get("plan", {}))
    has_pixels = any(name != "meta" for name in example)
    payloads = [example_payload(example, key=key, title=title, note=note)] if has_pixels else []
    write_atomic(page, examples_page(title, payloads, lead if has_pixels else [title, *lead]).encode())
    if has_pixels:
        write_atomic(picture, png_of(np.asarray(layer_tiles(example, [title, *filter(None, [note]), *lead]))))
    else:
        with output_errors(picture):
            # Of an earlier build
            picture.unlink(missing_ok=True)
    return ExampleFiles(page=page, picture=picture if has_pixels else None)


def example_title(key: str, plan: Mapping[str, Any]) -> str:
    """What an example is of, in a line. plan: as JSON; may be empty."""
    if not plan:
        return f"example {key}"
    target, rough = plan["target"]["object"], plan["rough"]
    lights = " + ".join(light["kind"] for light in plan["target_light"]["lights"])
    level = f"level {rough['level']} {rough['name']}".rstrip()
    return f"example {key}: {target['name']} in {plan['room']['name']}, {plan['split']}, {lights}, {level}"
