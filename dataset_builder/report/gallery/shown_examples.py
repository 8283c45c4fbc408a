"""Which examples of a dataset are shown: those of some splits, some of many, spread evenly; and how much they are."""

from collections.abc import Sequence

from dataset_builder.errors import Problem, UserError
from dataset_builder.remote.address import title_of
from dataset_builder.report.front.fill_page import script_json
from dataset_builder.report.gallery.example_payload import example_payload
from dataset_builder.report.gallery.gallery_entries import rejected_in, rejected_layers, thumbnail
from dataset_builder.shards.reader import Dataset
from dataset_builder.spec.problems import nearest
from dataset_builder.spread import runs, shares, spread_indices

TRIED = 4
"""Examples that sizes are estimated from."""
ENTRY = 2048
"""About the bytes that a page says of an example beside its pixels and its thumbnail."""

Keys = dict[str, list[str]]
"""Keys of examples by split."""


def chosen(dataset: Dataset, splits: Sequence[str], count: int | None) -> Keys:
    """Keys of the examples of some splits, all where none is named; `count`: of that many, spread over them.

    Raises UserError for a split that there is not.
    """
    there = list(dataset.splits)
    if unknown := [name for name in splits if name not in there]:
        raise UserError([Problem(where=title_of(dataset.folder), path="", hint=nearest(unknown[0], there, "split"),
                                 rule=f"expected splits among {', '.join(there)}, got {unknown[0]!r:.60}")])
    wanted = {name: list(keys) for name, keys in dataset.splits.items() if name in splits or not splits}
    if count is None:
        return wanted
    return spread(wanted, count)


def spread(splits: Keys, count: int) -> Keys:
    """Up to `count` keys: every split gets its share, at least one (be it more in all), spaced evenly."""
    found = zip(splits.items(), shares([len(keys) for keys in splits.values()], count), strict=True)
    return {name: [keys[run.start] for run in runs(len(keys), share)] for (name, keys), share in found}


def estimated_bytes(dataset: Dataset, splits: Keys) -> int:
    """About the bytes of a gallery, from a few examples of it and from all rejected ones that can be opened."""
    keys = [key for own in splits.values() for key in own]
    tried = [keys[index] for index in spread_indices(len(keys), min(TRIED, len(keys)))]
    found = 0
    for key in tried:
        example = dataset[key]
        found += len(script_json(example_payload(example))) + len(thumbnail(example)) * 4 // 3 + ENTRY
    kept = [path for _, path in rejected_in(dataset, list(splits)) if path]
    lost = sum(len(script_json(example_payload(layers, key=path.stem))) for path in kept
               if (layers := rejected_layers(path, dataset.layers)))
    return lost + (found * len(keys) // len(tried) if tried else 0)
