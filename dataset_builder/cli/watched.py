"""Builds that can be watched: in the terminal, and on a page."""

import argparse
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dataset_builder.cli.common import out_folder
from dataset_builder.cli.interrupt import interrupted, last_words
from dataset_builder.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from dataset_builder.builder import Event
    from dataset_builder.engine.field_tasks import FieldNews
    from dataset_builder.spec.resolve import LoadedSpec

Told = Callable[["FieldNews"], None]
Follow = Callable[[Iterable["Event"]], Iterator["Event"]]
SUFFIX = ".html"


def add_html(verb: argparse.ArgumentParser) -> None:
    """Where the page goes."""
    verb.add_argument("--html", type=_page, metavar="FILE",
                      help="write a page to watch the build with, and write it over every few seconds")


def _page(text: str) -> Path:
    """A file of HTML; another one would be some other file of the user's, which the page would take the place of."""
    path = out_folder(text)
    if path.suffix != SUFFIX:
        raise argparse.ArgumentTypeError(f"expected a file that ends in {SUFFIX}, got {text}")
    return path


@contextmanager
def followed(options: argparse.Namespace, loaded: "LoadedSpec", folder: Path,
             console: "Console") -> Iterator[tuple[Told, Follow]]:
    """What a build is to tell of its fields, and what its events are to pass through; the page ends as the build does.
    Raises UserError where `--html` names a folder or a file in that of the dataset."""
    from dataset_builder.report.build_progress import Following
    from dataset_builder.report.build_standing import BuildStanding
    from dataset_builder.report.watched_page import WatchedPage
    from dataset_builder.shards.staging import Staging

    standing = BuildStanding(loaded.dataset)
    shown = Following(console, standing)
    if options.html is None:
        yield shown.field, shown.events
        return
    _require_apart(options.html, folder)
    spec = loaded.dataset
    about = {"dataset": f"{spec.title or spec.name} {spec.version}, in {folder}",
             "spec": " ".join([str(options.spec), *(f"--set {text}" for text in loaded.overrides)]),
             "digest of the spec": loaded.spec_digest}
    page = WatchedPage(options.html, standing, name=spec.name, about=about, folder=folder,
                       staged=Staging(folder, getattr(options, "staging", "")),
                       warn=lambda text: console.print(text, highlight=False, soft_wrap=True))

    def told(news: "FieldNews") -> None:
        shown.field(news)
        page.field(news)

    with last_words(lambda: page.end("interrupted")):
        page.begin()
        try:
            yield told, lambda events: page.events(shown.events(events))
        except BaseException as error:
            if interrupted(error):
                page.end("interrupted")
            else:
                page.end("stopped", [str(each) for each in error.problems] if isinstance(error, UserError)
                         else [f"{type(error).__name__}: {error}"])
            raise
        page.end("finished")


def _require_apart(page: Path, folder: Path) -> None:
    """Raise UserError where the page is a folder, or would lie in that of the dataset, which has no other files."""
    if page.is_dir():
        raise UserError(f"--html: expected a file, got the folder {page}: name a file in it, as {page / 'build.html'}")
    if page.resolve().is_relative_to(folder.resolve()):
        raise UserError(f"--html: expected a file outside {folder}, which holds the dataset alone, got {page}: choose "
                        f"another place, as {folder.name}.html")
