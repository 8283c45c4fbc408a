"""Folders that files can be put into, here or at an address: what is put there is whole or not there."""

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from dataset_builder.digest import CHUNK_BYTES, open_regular, read_regular
from dataset_builder.errors import Problem, UserError
from dataset_builder.extras import missing_named
from dataset_builder.files import commit, output_errors, require_space, write_partial
from dataset_builder.remote.address import DRIVERS, is_address, local_path, refused, require_sound, said, shown

BUCKETS = ("s3", "gs")
"""Schemes whose files appear when they are whole, by themselves."""


class Shelf(Protocol):
    """A folder to put files into. Names are relative, with slashes. Every method raises UserError where it fails."""

    @property
    def title(self) -> str:
        """What messages call it: a path, or an address without passwords and keys."""

    def sizes(self) -> dict[str, int]:
        """Bytes of every file that is there, by name; empty where there is no such folder."""

    def read(self, name: str, *, most: int) -> bytes:
        """A whole file of at most `most` bytes."""

    def put(self, name: str, source: Path) -> None:
        """A copy of a file of this machine in the place of what has that name."""

    def remove(self, name: str) -> None:
        """Let a file go."""


def shelf_of(address: str | Path) -> Shelf:
    """The folder at a path, file://, s3:// or gs://. Raises UserError where it is none that can be written, or the
    package that writes it is not installed."""
    if isinstance(address, Path) or not is_address(address):
        return FolderShelf(Path(address))
    scheme = address.partition("://")[0].lower()
    if scheme == "file":
        return FolderShelf(local_path(address))
    if scheme not in BUCKETS:
        raise refused(address, f"expected a place that can be written, got {scheme}",
                      f"push to a path or to file, {', '.join(BUCKETS)} or hf, and let a server of yours serve it")
    require_sound(address, scheme)
    with missing_named():
        for library in DRIVERS[scheme]:
            importlib.import_module(library)
    return BucketShelf(address)


@dataclass(frozen=True)
class FolderShelf:
    """A folder on this machine."""

    folder: Path

    @property
    def title(self) -> str:
        """The path as it was given."""
        return str(self.folder)

    def sizes(self) -> dict[str, int]:
        """Regular files alone."""
        with output_errors(self.folder):
            found = [path for path in self.folder.rglob("*") if path.is_file() and not path.is_symlink()]
            return {path.relative_to(self.folder).as_posix(): path.stat().st_size for path in found}

    def read(self, name: str, *, most: int) -> bytes:
        """A whole file."""
        with output_errors(self.folder / name):
            return read_regular(self.folder / name, most=most)

    def put(self, name: str, source: Path) -> None:
        """Copied aside, flushed, renamed."""
        with output_errors(self.folder / name):
            require_space(self.folder, source.stat().st_size)
            with open_regular(source) as stream:
                write_partial(self.folder / name, iter(lambda: stream.read(CHUNK_BYTES), b""))
        commit(self.folder / name)

    def remove(self, name: str) -> None:
        """No error where it has gone."""
        with output_errors(self.folder / name):
            (self.folder / name).unlink(missing_ok=True)


@dataclass(frozen=True)
class BucketShelf:
    """Files below an address of an object store, by fsspec's file system, which tries again by itself."""

    address: str
    _files: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        import fsspec

        scheme = self.address.partition("://")[0].lower()
        object.__setattr__(self, "_files", fsspec.filesystem(scheme, skip_instance_cache=True,
                                                             use_listings_cache=False))

    @property
    def title(self) -> str:
        """The address without what is secret in it."""
        return shown(self.address)

    def sizes(self) -> dict[str, int]:
        """By one listing."""
        with self._errors(""):
            try:
                found = self._files.find(self._root, detail=True)
            except FileNotFoundError:
                return {}
        return {path.removeprefix(f"{self._root}/"): int(info["size"]) for path, info in found.items()}

    def read(self, name: str, *, most: int) -> bytes:
        """A whole file."""
        with self._errors(name):
            data: bytes = self._files.cat_file(f"{self._root}/{name}", end=most + 1)
        if len(data) > most:
            raise self._failed(name, f"larger than {most:,} bytes")
        return data

    def put(self, name: str, source: Path) -> None:
        """In parts where it is large; it appears when all of them are there."""
        with self._errors(name):
            self._files.put_file(str(source), f"{self._root}/{name}")

    def remove(self, name: str) -> None:
        """One object."""
        with self._errors(name):
            self._files.rm_file(f"{self._root}/{name}")

    @property
    def _root(self) -> str:
        return self.address.partition("://")[2].rstrip("/")

    @contextmanager
    def _errors(self, name: str) -> Iterator[None]:
        try:
            yield
        except UserError:
            raise
        except Exception as error:
            # What these libraries raise has no common class
            raise self._failed(name, said(error)) from error

    def _failed(self, name: str, rule: str) -> UserError:
        return UserError([Problem(where=self.title, path=name, rule=rule,
                                  hint="see to the bucket and your keys for it; what was sent is kept")])
