"""A flat folder of small files that are written whole, on this machine or wherever fsspec can write."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from dataset_builder.errors import OutputError, Problem
from dataset_builder.extras import missing_named
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.remote.address import local_path, said, shown


class FileBox(Protocol):
    """Files by name. Every method raises OutputError where the place refuses, but for `read`."""

    @property
    def title(self) -> str:
        """What messages call it."""

    def write(self, name: str, data: bytes) -> None:
        """A whole file, in the place of one of that name."""

    def read(self, name: str) -> bytes:
        """A whole file. Raises OSError where there is none, or it cannot be read."""

    def sizes(self, pattern: str) -> dict[str, int]:
        """Bytes of the files whose names fit a pattern of `*` and text, by name, sorted."""

    def remove(self, name: str) -> None:
        """Let a file go that is there."""


class FolderBox:
    """A folder on this machine, made when something is written."""

    def __init__(self, folder: Path):
        self._folder = folder

    @property
    def title(self) -> str:
        """The path."""
        return str(self._folder)

    def write(self, name: str, data: bytes) -> None:
        """Aside, flushed, renamed."""
        write_atomic(self._folder / name, data)

    def read(self, name: str) -> bytes:
        """A whole file."""
        return (self._folder / name).read_bytes()

    def sizes(self, pattern: str) -> dict[str, int]:
        """Bytes by name; files may go while others build."""
        with output_errors(self._folder):
            return {path.name: _size(path) for path in sorted(self._folder.glob(pattern))}

    def remove(self, name: str) -> None:
        """Let a file go."""
        with output_errors(self._folder):
            (self._folder / name).unlink()


class UrlBox:
    """A folder at an address that fsspec knows. Stores of objects write a file whole or not at all; elsewhere a reader
    has to see that it is."""

    def __init__(self, url: str):
        with missing_named():
            from fsspec.core import url_to_fs

            with self._errors(url):
                self._files, self._root = url_to_fs(url)
        self._url = url

    @property
    def title(self) -> str:
        """The address without what may be a password."""
        return shown(self._url)

    def write(self, name: str, data: bytes) -> None:
        """A whole file."""
        with self._errors(self._url):
            self._files.makedirs(self._root, exist_ok=True)
            self._files.pipe_file(self._path(name), data)

    def read(self, name: str) -> bytes:
        """A whole file."""
        found: bytes = self._files.cat_file(self._path(name))
        return found

    def sizes(self, pattern: str) -> dict[str, int]:
        """Bytes by name, as they are now."""
        with self._errors(self._url):
            self._files.invalidate_cache()
            found: dict[str, Any] = self._files.glob(self._path(pattern), detail=True)
        return {os.path.basename(path): int(told.get("size") or 0) for path, told in sorted(found.items())}

    def remove(self, name: str) -> None:
        """Let a file go."""
        with self._errors(self._url):
            self._files.rm_file(self._path(name))

    def _path(self, name: str) -> str:
        return f"{self._root.rstrip('/')}/{name}"

    @contextmanager
    def _errors(self, url: str) -> Iterator[None]:
        try:
            yield
        # Libraries of stores have errors of their own, which have nothing in common
        except (OutputError, ModuleNotFoundError):
            raise
        except Exception as error:
            rule = f"expected a place that can be written, got: {said(error)}"
            raise OutputError([Problem(where=shown(url), path="--staging", rule=rule,
                                       hint="see that it exists, and that every machine may write it")]) from error


def box_at(folder: Path, url: str) -> FileBox:
    """The folder, unless an address is given. Raises UserError where it is one of a file on another host, OutputError
    where nothing can be written to such a one."""
    if not url:
        return FolderBox(folder)
    return FolderBox(local_path(url)) if url.lower().startswith("file:") else UrlBox(url)


def _size(path: Path) -> int:
    """Bytes of a file; 0 where it has gone."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0
