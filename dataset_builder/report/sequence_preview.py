"""The views of a sequence to look at: a strip of some of them, and all of them as an animated PNG."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from dataset_builder.errors import Problem, UserError
from dataset_builder.files import write_atomic
from dataset_builder.report.example_sheet import SheetRow, sheet
from dataset_builder.shards.reader import Dataset, load_manifest, open_dataset
from dataset_builder.spread import spread_indices
from dataset_builder.tonemap import exposure, to_8bit

SOURCE = "i_s"
SHOWN = {SOURCE: "I_s", "s_prime": "S'", "i_t": "I_t"}
"""Layers by what they are called; the first is lit by the source, the others by the target."""
STRIP, CELL, MILLISECONDS = 10, 128, 80
LARGEST = 256
"""Most pixels along a side of a frame of an animation, for each layer."""
NAMED = 8


@dataclass(frozen=True, kw_only=True)
class PreviewFiles:
    """Where previews of a sequence lie."""

    strip: Path
    """PNG: layers as rows, up to `STRIP` views as columns."""
    animation: Path
    """Animated PNG: layers side by side."""
    views: int


def write_preview(folder: Path, name: str, out: Path | None = None) -> PreviewFiles:
    """Write the previews of the sequence `name` of a finished dataset: of the first light and noise level, or of those
    that the name ends in, `turn-00-03-1-0`. out: a folder, by default `previews` in that of the dataset.

    Light is tone-mapped at one exposure for all views, I_s at one of its own. Raises UserError where there is no such
    sequence or none of the layers, OutputError where the disk refuses.
    """
    layers = [layer.name for layer in load_manifest(folder).layers if layer.name in SHOWN]
    if not layers:
        raise _wrong(folder, f"expected a layer to look at, of {', '.join(SHOWN)}, got none")
    layers.sort(key=[*SHOWN].index)
    dataset = open_dataset(folder, layers=layers)
    found_at = dict(sorted(places(dataset, folder, name).items()))
    keys = [*found_at.values()]
    groups = [[layer for layer in layers if (layer == SOURCE) == of_source] for of_source in (True, False)]
    factors = {layer: factor for group in groups if group for factor in [_exposure(dataset, keys, group)]
               for layer in group}
    out = out or folder / "previews"
    found = PreviewFiles(strip=out / f"{name}-strip.png", animation=out / f"{name}.png", views=len(keys))
    chosen = [[*found_at.items()][place] for place in spread_indices(len(keys), STRIP)]
    rows = [SheetRow(lines=[SHOWN[layer]], panels={f"view {frame}": to_8bit(dataset[key][layer], factors[layer])
                                                   for frame, key in chosen}) for layer in layers]
    stream = BytesIO()
    sheet(rows, CELL).save(stream, "PNG")
    write_atomic(found.strip, stream.getvalue())
    write_atomic(found.animation, animated(Image.fromarray(np.concatenate(
        [small(to_8bit(example[layer], factors[layer])) for layer in layers], axis=1))
        for example in map(dataset.__getitem__, keys)))
    return found


def animated(frames: Iterator[Image.Image]) -> bytes:
    """An animated PNG of frames of one size, without end."""
    stream = BytesIO()
    next(frames).save(stream, "PNG", save_all=True, append_images=list(frames), duration=MILLISECONDS, loop=0)
    return stream.getvalue()


def places(dataset: Dataset, folder: Path, name: str) -> dict[int, str]:
    """Keys of a sequence by their frames, of the first light and noise level where the name does not end in both.
    Raises UserError where there is none of that name."""
    found: dict[str, dict[int, str]] = {}
    for key in (key for keys in dataset.splits.values() for key in keys):
        plan = dataset.label(key).plan
        if plan.sequence.name:
            for called in (plan.sequence.name, plan.sequence.example_name(plan.light, plan.rough.level)):
                # The first light and level that a view has
                found.setdefault(called, {}).setdefault(plan.sequence.frame, key)
    if name in found:
        return found[name]
    known = [each for each in found if each.count("-") == min(each.count("-") for each in found)]
    rule = f"expected a sequence, got {name!r:.60}; there are " + (
        ", ".join(known[:NAMED]) + (", ..." if len(known) > NAMED else "") if known else "none")
    raise _wrong(folder, rule)


def _exposure(dataset: Dataset, keys: Sequence[str], layers: Sequence[str]) -> float:
    """The exposure of some layers over all views, from so many of their pixels that memory does not matter."""
    step = max(1, dataset.manifest.width // LARGEST)
    return exposure(dataset[key][layer][::step, ::step] for key in keys for layer in layers)


def small(pixels: np.ndarray) -> np.ndarray:
    """The picture, averaged down to `LARGEST` pixels along its longer side."""
    picture = Image.fromarray(pixels)
    if max(picture.size) <= LARGEST:
        return pixels
    scale = LARGEST / max(picture.size)
    size = max(round(picture.width * scale), 1), max(round(picture.height * scale), 1)
    return np.asarray(picture.resize(size, Image.Resampling.BOX))


def _wrong(folder: Path, rule: str) -> UserError:
    return UserError([Problem(where=str(folder), path="--sequence", rule=rule)])
