"""A bar on the terminal while things are done one by one."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import track

Item = TypeVar("Item")


def with_bar(what: str, items: Iterable[Item], count: int | None = None) -> Iterator[Item]:
    """Items one by one, while a bar called `what` shows how many of `count` are done; nothing is shown where there is
    no terminal. count: needed where `items` has no length."""
    console = Console(stderr=True)
    yield from track(items, description=what, total=count, console=console, transient=True,
                     disable=not console.is_terminal)
