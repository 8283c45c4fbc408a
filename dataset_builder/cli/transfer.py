"""The verbs `pull` and `push`: datasets from and to other machines."""

import argparse
import re
import sys
from time import monotonic
from typing import TYPE_CHECKING

from dataset_builder.byte_store import GB
from dataset_builder.cli.common import Verbs, add_verb, gigabytes, local_folder, out_folder, positive

if TYPE_CHECKING:
    from dataset_builder.transfer.fetching import TransferProgress

PATTERNS = (("split", "splits"), ("scene", "scenes"), ("object", "target objects"), ("category", "kinds of object"),
            ("level", "noise levels, by number or name"), ("light", "target lights, by number"))
"""Options of `pull` that may be repeated, and what they choose."""
ADDRESS = "path, http(s)://, s3://, gs:// or hf://datasets/USER/NAME"
OFTEN = 1.0
"""Seconds between two lines of progress; on a terminal they replace each other."""


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
    pull.add_argument("--most", type=gigabytes, metavar="GB", help="refuse to fetch more")
    pull.add_argument("--replace", action="store_true",
                      help="let the other dataset, major version or choice go that the folder holds")
    push = add_verb(verbs, "push", _push, "send a finished dataset to where others pull it, or resume a push")
    push.add_argument("folder", type=local_folder, help="finished dataset")
    push.add_argument("address", help="where to: path, s3://, gs:// or hf://datasets/USER/NAME")
    push.add_argument("--replace", action="store_true", help="let another dataset or version there make room")
    push.add_argument("--prune", action="store_true", help="remove shards there that are not listed any more")


def _push(options: argparse.Namespace) -> int:
    from dataset_builder.transfer.push import push

    line = _Line()
    pushed = push(options.folder, options.address, replace=options.replace, prune=options.prune, told=line.told)
    line.end()
    print(f"{pushed.files} files sent, {pushed.sent} bytes; what is there reads back\n"
          f"SHA-256 of dataset.json, for pull --pin: {pushed.sha256}")
    if pushed.left:
        print(f"{len(pushed.left)} files there are of no release any more; --prune removes them")
    return 0


def _pull(options: argparse.Namespace) -> int:
    from dataset_builder.transfer.choice import ExampleChoice
    from dataset_builder.transfer.pull import pull

    layers = tuple(name for text in options.layers for name in text.split(","))
    patterns = {name: tuple(getattr(options, name)) for name, _ in PATTERNS}
    choice = ExampleChoice(**patterns, layers=layers, count=options.count)
    line = _Line()
    pulled = pull(options.address, options.folder, choice=choice, sha256=options.pin or "", most=options.most,
                  replace=options.replace, told=line.told)
    line.end()
    totals = pulled.manifest.totals
    for split in pulled.manifest.splits:
        print(f"{split.name}: {split.examples} examples in {len(split.shards)} shards")
    print(f"{totals.examples} examples, {totals.bytes} bytes; {pulled.wanted} bytes wanted, {pulled.moved} fetched\n"
          f"dataset: {options.folder}")
    return 0


def _sha256(text: str) -> str:
    """A digest as argparse wants it."""
    if not re.fullmatch("[0-9a-fA-F]{64}", text):
        raise argparse.ArgumentTypeError(f"expected 64 hexadecimal digits, got {text or 'none'}")
    return text


class _Line:
    """TransferProgress on the terminal, in one line."""

    def __init__(self) -> None:
        self._next, self._shown = monotonic() + OFTEN, False

    def told(self, progress: "TransferProgress") -> None:
        """Show how far it is, now and then."""
        if monotonic() < self._next:
            return
        self._next, self._shown = monotonic() + OFTEN, True
        left = f"{progress.left:.0f} s left" if progress.left < float("inf") else ""
        text = f"{progress.done / GB:.3f} of {progress.total / GB:.3f} GB, {progress.rate / 1e6:.1f} MB/s, {left}"
        if not progress.total:
            # What is wanted is known when the indexes are there
            text = f"{progress.moved / 1e6:.1f} MB of indexes"
        print(f"\r{text:60}" if sys.stderr.isatty() else text, end="" if sys.stderr.isatty() else "\n",
              file=sys.stderr, flush=True)

    def end(self) -> None:
        """Leave the line."""
        if self._shown and sys.stderr.isatty():
            print(file=sys.stderr)
