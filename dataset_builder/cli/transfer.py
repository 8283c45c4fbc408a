"""The verbs `pull` and `push`: datasets from and to other machines."""

import argparse
import re
from collections.abc import Callable
from contextlib import closing
from typing import TYPE_CHECKING

from dataset_builder.cli.common import Verbs, add_folder, add_verb, gigabytes, names, out_folder, positive
from dataset_builder.cli.rate_line import RateLine
from dataset_builder.errors import count_of

if TYPE_CHECKING:
    from dataset_builder.transfer.fetching import TransferProgress

PATTERNS = (("split", "splits"), ("scene", "scenes"), ("object", "target objects"), ("category", "kinds of object"),
            ("level", "noise levels, by number or name"), ("light", "target lights, by number"))
"""Options of `pull` that may be repeated, and what they choose."""
ADDRESS = "path, http(s)://, s3://, gs:// or hf://datasets/USER/NAME"


def add(verbs: Verbs) -> None:
    """Add both verbs."""
    pull = add_verb(verbs, "pull", _pull, "fetch a dataset, or chosen examples of one, or resume an interrupted pull")
    pull.add_argument("address", help=f"where a finished dataset lies: {ADDRESS}")
    pull.add_argument("folder", type=out_folder, help="where to")
    for name, chosen in PATTERNS:
        pull.add_argument(f"--{name}", action="append", default=[], metavar="PATTERN",
                          help=f"only these {chosen}; repeat for more")
    pull.add_argument("--layers", action="append", default=[], metavar="A,B",
                      help="only these layers; labels and previews always come with them")
    pull.add_argument("--count", type=positive, metavar="N", help="the first N examples of every split that match")
    pull.add_argument("--pin", type=_sha256, metavar="HEX", help="SHA-256 that dataset.json at the address must have")
    pull.add_argument("--most", type=gigabytes, metavar="GB",
                      help="refuse to fetch more GB (1e9 bytes), or bytes with a unit, as 4GiB")
    pull.add_argument("--replace", action="store_true",
                      help="replace another dataset, major version or choice in the folder")
    push = add_verb(verbs, "push", _push, "send a finished dataset to where others pull it, or resume a push")
    add_folder(push)
    push.add_argument("address", help="where to: path, s3://, gs:// or hf://datasets/USER/NAME")
    push.add_argument("--replace", action="store_true", help="replace another dataset or version at the address")
    push.add_argument("--prune", action="store_true", help="remove shards there that are not listed any more")


def _push(options: argparse.Namespace) -> int:
    from dataset_builder.transfer.push import push

    with closing(RateLine()) as line:
        pushed = push(options.folder, options.address, replace=options.replace, prune=options.prune, told=_on(line))
    print(f"{pushed.files} files sent, {pushed.sent} bytes; the dataset there opens as others will see it\n"
          f"SHA-256 of dataset.json, for pull --pin: {pushed.sha256}")
    if pushed.left:
        print(f"{len(pushed.left)} shards and indexes there belong to no release any more; --prune removes them")
    return 0


def _pull(options: argparse.Namespace) -> int:
    from dataset_builder.transfer.choice import ExampleChoice
    from dataset_builder.transfer.pull import pull

    patterns = {name: tuple(getattr(options, name)) for name, _ in PATTERNS}
    choice = ExampleChoice(**patterns, layers=names(options.layers), count=options.count)
    with closing(RateLine()) as line:
        pulled = pull(options.address, options.folder, choice=choice, sha256=options.pin or "", most=options.most,
                      replace=options.replace, told=_on(line))
    totals = pulled.manifest.totals
    for split in pulled.manifest.splits:
        print(f"{split.name}: {count_of(split.examples, 'example')} in {count_of(len(split.shards), 'shard')}")
    print(f"{totals.examples} examples, {totals.bytes} bytes; {pulled.wanted} bytes wanted, {pulled.moved} fetched\n"
          f"dataset: {options.folder}")
    return 0


def _on(line: RateLine) -> Callable[["TransferProgress"], None]:
    return lambda progress: line.told(progress.done, progress.total, progress.rate)


def _sha256(text: str) -> str:
    """A digest as argparse wants it."""
    if not re.fullmatch("[0-9a-fA-F]{64}", text):
        raise argparse.ArgumentTypeError(f"expected 64 hexadecimal digits, got {text or 'none'}")
    return text
