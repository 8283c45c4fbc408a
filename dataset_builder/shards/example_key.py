"""Which example somebody means who types a key, an index, or a place in a split."""

from dataset_builder.errors import Problem, UserError
from dataset_builder.remote.address import title_of
from dataset_builder.shards.reader import Dataset
from dataset_builder.spec.problems import nearest

DIGITS = 8


def key_of(dataset: Dataset, text: str) -> str:
    """The key of an example that is named by its key (`00000012`), its index (`12`) or its place in a split
    (`train:3`, from 0, the n-th that is there). Raises UserError, with the nearest key, where there is none."""
    split, colon, place = text.rpartition(":")
    if colon and split in dataset.splits and place.isdecimal() and int(place) < len(dataset.splits[split]):
        return dataset.splits[split][int(place)]
    if not colon and text.isdecimal() and (key := text.zfill(DIGITS)) in dataset:
        return key
    if colon and split in dataset.splits:
        rule, hint = f"expected {split}:0 to {split}:{len(dataset.splits[split]) - 1}, got {text!r:.60}", ""
    else:
        some = next(iter(dataset.splits))
        rule = f"expected the key of an example, such as 00000012, 12 or {some}:0, got {text!r:.60}"
        hint = nearest(text, [key for keys in dataset.splits.values() for key in keys], "key")
    raise UserError([Problem(where=title_of(dataset.folder), path="", rule=rule, hint=hint)])
