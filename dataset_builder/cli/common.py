"""What the options of several verbs have in common, and the terminal that they print to."""

import argparse
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dataset_builder.byte_store import CACHE_SIZE, GB
from dataset_builder.errors import UserError, count_of, printable
from dataset_builder.remote.address import bare, is_address, local_path, shown

if TYPE_CHECKING:
    from rich.console import Console

    from dataset_builder.lightnet.settings import TrainingSpec

STUDIES, TRAININGS = Path("studies"), Path("trainings")
"""Where results go unless `--out` says otherwise."""

MAX_GB = 1_000_000
SIZE_UNITS = {f"{letter}{end}": base**power for power, letter in enumerate("kmgt", start=1)
              for end, base in (("b", 1000), ("ib", 1024))}
"""Bytes of a unit, in small letters."""
MOST = 1e9
"""Of prices and speeds."""
BACKENDS = ("auto", "cuda", "llvm")
DEVICES = ("auto", "cpu", "cuda")
"""Where networks run; auto is CUDA where there is one."""

WIDTH = 140
"""Columns where the output is no terminal."""

Verbs = Any
"""What `argparse.ArgumentParser.add_subparsers` returns; its type has no public name."""


def add_verb(verbs: Verbs, name: str, run: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
    """A verb that calls `run`; text: what it does, in a line."""
    verb: argparse.ArgumentParser = verbs.add_parser(name, help=text, description=text)
    verb.set_defaults(run=run)
    return verb


def add_spec(verb: argparse.ArgumentParser) -> None:
    """A dataset spec and overrides of it."""
    verb.add_argument("spec", type=Path, help="dataset spec, a YAML file")
    add_overrides(verb, "the spec")


def add_folder(verb: argparse.ArgumentParser) -> None:
    """The folder of a finished dataset."""
    verb.add_argument("folder", type=local_folder, help="finished dataset")


def add_dataset(verb: argparse.ArgumentParser) -> None:
    """The folder of a finished dataset, or its address."""
    verb.add_argument("folder", type=_dataset, metavar="FOLDER", help="finished dataset, or its address")


def names(texts: Iterable[str]) -> tuple[str, ...]:
    """Names that were given one by one, or with commas between; an empty one is left to be refused."""
    return tuple(name for text in texts for name in text.split(","))


def add_overrides(verb: argparse.ArgumentParser, of: str, option: str = "--set", dest: str = "overrides") -> None:
    """`--set A.B=C`, as often as wanted."""
    verb.add_argument(option, action="append", default=[], metavar="A.B=C", dest=dest,
                      help=f"override a value of {of}; repeat for more")


def add_backend(verb: argparse.ArgumentParser) -> None:
    """What renders."""
    verb.add_argument("--backend", choices=BACKENDS, default="auto", help="renderer backend (default: the GPU, if any)")


def add_networks(verb: argparse.ArgumentParser, *, trains: bool = True) -> None:
    """Where networks run and, where they are trained, the weights of the feature loss."""
    if trains:
        verb.add_argument("--vgg-weights", type=Path, metavar="FILE",
                          help="VGG-19 trained on ImageNet, for the feature reconstruction loss; off without it")
    verb.add_argument("--device", choices=DEVICES, default="auto", help="where networks run (default: the GPU, if any)")


def lightnet(config: Path | None, overrides: list[str], steps: int | None) -> "TrainingSpec":
    """LighTNet's configuration, from which a study derives its trainings; `--steps N` is short for `--set steps=N`."""
    from dataset_builder.lightnet.settings import load_training
    from dataset_builder.studies.trainings import base_of

    return base_of(load_training(config, [*overrides, *([f"steps={steps}"] if steps else [])]))


def add_cache(verb: argparse.ArgumentParser) -> None:
    """Where results of passes are kept, and how much of them."""
    verb.add_argument("--cache", type=out_folder, metavar="DIR",
                      help="folder for results of passes, which datasets may share (default: in the output folder)")
    verb.add_argument("--cache-size", type=gigabytes, default=CACHE_SIZE, metavar="GB",
                      help=f"most that is kept there, in GB (1e9 bytes) or with a unit, as 4GiB; 0 keeps nothing "
                           f"(default: {CACHE_SIZE / GB:g})")


def local_folder(text: str) -> Path:
    """The folder of a dataset, where an address would not do."""
    found = _dataset(text)
    if isinstance(found, str):
        rule = f"expected a folder on this machine, got the address {bare(found)}"
        raise argparse.ArgumentTypeError(f"{rule}: fetch it first, with dataset-builder pull")
    return found


def out_folder(text: str) -> Path:
    """A path to write to, which has a name, where an address would not do."""
    if not text.strip():
        raise argparse.ArgumentTypeError("expected a folder, got an empty name: write . for the current one")
    found = _dataset(text)
    if isinstance(found, str):
        rule = f"expected a path on this machine, got the address {bare(found)}"
        raise argparse.ArgumentTypeError(f"{rule}: write here first, then send it there, as dataset-builder push does")
    return found


def name_of(folder: Path | str) -> str:
    """Name of a dataset's folder, also of one at an address."""
    return folder.resolve().name if isinstance(folder, Path) else shown(folder).rpartition("/")[2]


def _dataset(text: str) -> Path | str:
    """A path as such, and the path that an address with `file` stands for; another address as it is."""
    if not is_address(text):
        return Path(text)
    return local_path(text) if text.lower().startswith("file:") else text


def gigabytes(text: str) -> int:
    """Bytes of a number of gigabytes, or of a number with a unit: `4`, `4GB`, `3.7GiB`, `500 MiB`."""
    number = text.rstrip().rstrip("BGIKMTbgikmt")
    try:
        size = float(number) * SIZE_UNITS[text[len(number):].strip().lower() or "gb"]
    except (ValueError, KeyError):
        size = -1.0
    if not 0 <= size <= MAX_GB * GB:
        raise argparse.ArgumentTypeError(f"expected GB from 0 to {MAX_GB:,}, or a number with a unit, such as 500MiB, "
                                         f"got {text}")
    return round(size)


def positive(text: str) -> int:
    """A whole number from 1 on, as argparse wants it."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1, got {text}")
    return int(text)


def before_study(count: int, wanted: int) -> str:
    """What a study of `count` examples says before its first: all, where more were wanted."""
    whole = f", all that the spec has; {wanted:,} were asked for" if count < wanted else ""
    return f"{count_of(count, 'example')}{whole}: the first one tells how long the others will take"


def example_index(text: str) -> int:
    """The index of an example, as argparse wants it."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"expected the index of an example, 0 or more, got {text}")
    return int(text)


def positive_number(text: str) -> float:
    """A finite number above 0, as argparse wants it."""
    with suppress(ValueError):
        if 0 < (found := float(text)) < MOST:
            return found
    raise argparse.ArgumentTypeError(f"expected a number above 0 and below {MOST:,.0f}, got {text}")


def plain_console(width: int | None = None) -> "Console":
    """The terminal. What specs and datasets call things is printed as it is, `[/]` and `:x:` mean nothing; control
    characters are printed as escapes."""
    from rich.console import Console
    from rich.text import Text

    class Terminal(Console):
        """All text of lines and tables comes by here."""

        def render_str(self, text: str, **how: Any) -> Text:
            """The text, safe to print."""
            return super().render_str("\n".join(map(printable, text.split("\n"))), **how)

    return Terminal(markup=False, emoji=False, width=width)


def wide_console() -> "Console":
    """The terminal, or a wide page where there is none."""
    console = plain_console()
    return console if console.is_terminal else plain_console(WIDTH)


def numbers(option: str, text: str, count: int) -> list[float]:
    """So many finite numbers between commas. Raises UserError."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count or not all(abs(number) < 1e9 for number in found):
        raise UserError(f"{option}: expected {count} number{'s, with commas between' * (count > 1)}, got {text}")
    return found
