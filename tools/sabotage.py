"""Write a spoilt copy of a dataset that is whole by every hash: `python tools/sabotage.py DIR OUT KIND`.

For trying out whether `dataset-builder validate` says no. Shards, indexes, statistics in labels, previews and manifest
are made anew from the spoilt layers, so that nothing but their meaning is wrong.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt

from dataset_builder.errors import UserError
from dataset_builder.layers import LAYERS
from dataset_builder.seeding import rng
from dataset_builder.shards.example import Example, encode_members, preview
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.manifest import Manifest, from_json, with_shards
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.reader import Dataset, open_dataset
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import entry, index_path, publish_shard

SHIFT = 8
"""Columns that a mask moves to the right."""
SEED = 0
Layers = dict[str, np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Source:
    """A dataset to spoil. partner: by key, the example whose S' it is given; never itself."""

    dataset: Dataset
    partner: Mapping[str, str]

    def s_prime_of_partner(self, key: str) -> Layers:
        """Layers of the example's partner."""
        return self.dataset[self.partner[key]]


Spoil = Callable[[Source, str, Layers], Layers]
"""The layers that change, from all of an example's."""


def encoded(name: str, source: Source, key: str, layers: Layers) -> Layers:
    """A layer under the sRGB curve (IEC 61966-2-1), as if it came from a picture for screens; above 1 it goes on."""
    x = layers[name].astype(np.float64)
    curve = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)
    return {name: curve.astype(np.float32)}


def swapped(source: Source, key: str, layers: Layers) -> Layers:
    """D in the place of R, R in the place of D."""
    return {"d": layers["r"], "r": layers["d"]}


def shuffled(source: Source, key: str, layers: Layers) -> Layers:
    """S' of another example, as it is there."""
    return {"s_prime": source.s_prime_of_partner(key)["s_prime"]}


def fitted(source: Source, key: str, layers: Layers) -> Layers:
    """S' of another example, drawn on into this one's outline from the nearest pixel, so that `outside` holds."""
    other = source.s_prime_of_partner(key)
    nothing = ~silhouette(other)
    rows, columns = distance_transform_edt(nothing, return_distances=False, return_indices=True)
    return {"s_prime": other["s_prime"][rows, columns] * silhouette(layers)[..., None]}


def matched(source: Source, key: str, layers: Layers) -> Layers:
    """As `fitted`, brought to this example's own mean colour: strength and colour of the light stay right."""
    own, other = layers["s_prime"], fitted(source, key, layers)["s_prime"]
    total = np.maximum(other.sum(axis=(0, 1), dtype=np.float64), 1e-12)
    return {"s_prime": (other * (own.sum(axis=(0, 1), dtype=np.float64) / total)).astype(np.float32)}


def shifted_mask(source: Source, key: str, layers: Layers) -> Layers:
    """The mask eight pixels to the right; everything else where it was."""
    return {"mask": moved(layers["mask"])}


def shifted_and_cut(source: Source, key: str, layers: Layers) -> Layers:
    """The same, and layers of the object cut to the mask, so that `outside` holds."""
    mask = moved(layers["mask"])
    extents = {layer.name: layer.extent for layer in source.dataset.manifest.layers}
    outside = {"3dm": mask == 0, "r3dm": (mask == 0) & ~silhouette(layers | {"mask": mask})[..., None]}
    cut = {name: np.where(outside[LAYERS[name].geometry], 0, array).astype(np.float32)
           for name, array in layers.items() if extents[name] == "object" and not name.startswith(("mask", "instance"))}
    return {**cut, "mask": mask}


def shifted_object(source: Source, key: str, layers: Layers) -> Layers:
    """Every layer but those with radiance of the frame eight pixels to the right: they agree with one another."""
    return {name: moved(array) for name, array in layers.items()
            if LAYERS[name].render_pass not in ("source", "target")}


KINDS: dict[str, Spoil] = {
    "shuffle_s_prime": shuffled, "shuffle_s_prime_fitted": fitted, "shuffle_s_prime_matched": matched,
    "swap_d_r": swapped,
    **{f"gamma_{name}": partial(encoded, name) for name in ("i_s", "i_t", "s_prime", "d", "r")},
    "shift_mask": shifted_mask, "shift_mask_cut": shifted_and_cut, "shift_object": shifted_object,
}


def moved(layer: np.ndarray) -> np.ndarray:
    """An (H, W, C) layer `SHIFT` columns to the right, 0 where nothing came from."""
    result = np.zeros_like(layer)
    result[:, SHIFT:] = layer[:, :-SHIFT]
    return result


def silhouette(layers: Layers) -> np.ndarray:
    """(H, W) truth: where a layer of the R3DM may be."""
    mask = layers["mask"][..., 0] > 0
    return mask | (layers["mask_rough"][..., 0] > 0) if "mask_rough" in layers else mask


def partners(keys: Sequence[str]) -> dict[str, str]:
    """For every key another one, by chance."""
    order = [keys[i] for i in rng(SEED, "partners").permutation(len(keys))]
    return dict(zip(order, [*order[1:], order[0]], strict=True))


def spoilt(source: Source, keys: Sequence[str], spoil: Spoil) -> Iterator[Example]:
    """Examples with their spoilt layers, one at a time."""
    for key in keys:
        example = source.dataset[key]
        label, layers = source.dataset.label(key), {name: example[name] for name in source.dataset.layers}
        yield Example(plan=label.plan, record=label.record, layers=layers | spoil(source, key, layers))


def sabotage(folder: Path, out: Path, kind: str) -> Manifest:
    """Write the spoilt copy. Raises ShardError where `folder` is no finished dataset, OutputError where `out` is not
    to be written to."""
    dataset = open_dataset(folder)
    keys = [key for split in dataset.splits.values() for key in split]
    source = Source(dataset=dataset, partner=partners(keys))
    with build_lock(out, Claim(name=dataset.manifest.name, version=dataset.manifest.version)):
        shards = [_shard(source, out, shard, KINDS[kind]) for shard in dataset.manifest.shards]
        manifest = with_shards(dataset.manifest, shards)
        publish_dataset(out, manifest)
        Staging(out).clear()
    return manifest


def _shard(source: Source, out: Path, shard: ShardRecord, spoil: Spoil) -> ShardRecord:
    folder, dtype = source.dataset.folder, source.dataset.manifest.layers[0].dtype
    index = from_json(ShardIndex, index_path(folder, shard.stem).read_bytes(), where=shard.stem)
    records = {record.key: record for record in index.examples}
    for example in spoilt(source, list(records), spoil):
        members = encode_members(example, dtype=dtype, preview_png=preview(example.layers))
        record = records[example.key]
        Staging(out).put(example.key, record.digest, segment(members),
                         entry(key=example.key, view=record.view, facts=record.facts, members=members))
    examples = [(key, record.digest) for key, record in records.items()]
    return publish_shard(out, slot=shard.slot, split=shard.split, examples=examples, spec_digest=index.spec_digest,
                         versions=index.versions).shard


def main(arguments: Sequence[str] | None = None) -> int:
    """Spoil as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished dataset, which stays as it is")
    parser.add_argument("out", type=Path, metavar="OUT", help="new folder")
    parser.add_argument("kind", choices=tuple(KINDS), metavar="KIND", help=", ".join(KINDS))
    options = parser.parse_args(arguments)
    try:
        manifest = sabotage(options.folder, options.out, options.kind)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{options.out}: {manifest.totals.examples} examples, {options.kind}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
