"""Where a build runs: options that say so, and the engine that they mean."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dataset_builder.errors import UserError
from dataset_builder.remote.address import is_address

if TYPE_CHECKING:
    from rich.console import Console

ENGINES = ("local", "ray")


@dataclass(frozen=True, kw_only=True)
class Engine:
    """What `builder.build` needs to know of it."""

    run: Callable[..., Iterator[Any]]
    backend: str
    workers: int | None
    staging_url: str = ""


def add_engine(verb: argparse.ArgumentParser) -> None:
    """Where a build runs."""
    verb.add_argument("--engine", choices=ENGINES, default="local",
                      help="what runs a build: this machine, or the machines of a Ray cluster (default: local)")
    verb.add_argument("--address", metavar="A", help="Ray cluster: auto, HOST:6379 or ray://HOST:10001 (default: a Ray "
                                                     "on this machine)")
    verb.add_argument("--staging", type=_staging, default="", metavar="URL",
                      help="where workers put finished examples, file:///..., s3://... (default: they travel here)")


def _staging(text: str) -> str:
    """An address; that of a path where one is given."""
    return text if not text or is_address(text) else Path(text).absolute().as_uri()


@contextmanager
def engine_of(options: argparse.Namespace, console: "Console") -> Iterator[Engine]:
    """The engine that options ask for, with a line on it. Raises UserError where they do not fit, or it is not there.
    """
    if options.engine == "local":
        from dataset_builder.engine import local
        from dataset_builder.rendering.backend import choose

        for name in ("address", "staging"):
            if getattr(options, name):
                raise UserError(f"--{name}: expected --engine ray with it, got --engine local")
        console.print(f"backend: {choose(options.backend).summary}", highlight=False)
        yield Engine(run=local.run, backend=options.backend, workers=options.workers)
        return
    from dataset_builder.engine.ray_cluster import RayCluster

    def say(line: str) -> None:
        console.print(line, highlight=False, soft_wrap=True)

    with RayCluster(options.address, say=say, cpus=options.workers) as cluster:
        backend = cluster.backend(options.backend)
        say(cluster.summary(backend, options.workers))
        yield Engine(run=cluster.run, backend=backend, workers=options.workers or cluster.workers(backend),
                     staging_url=options.staging)
