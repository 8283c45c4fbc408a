"""Large images that the processes of a build share: the first reads one, the others find its texels, one at a time."""

import fcntl
import os
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from dataset_builder.errors import OutputError

SHAPE = struct.Struct("<3I")
"""Before the texels: their shape."""


class TexelStore(Protocol):
    """Bytes by key; what was put may have gone, and what comes back is whole."""

    def get(self, key: str) -> bytes | None:
        """The bytes of a key, or None."""

    def put(self, key: str, value: bytes) -> None:
        """Keep bytes under a key. Raises OutputError where the disk refuses."""


@dataclass(frozen=True, kw_only=True)
class TexelMemory:
    """Where processes share texels."""

    store: TexelStore
    lock: Path
    """File that a process locks while it looks for an image's texels or reads them."""
    made_by: str
    """Digest of what turns an image into texels."""


_SHARED: ContextVar[TexelMemory | None] = ContextVar("texels", default=None)


@contextmanager
def sharing_texels(memory: TexelMemory) -> Iterator[None]:
    """Share what is read meanwhile."""
    token = _SHARED.set(memory)
    try:
        yield
    finally:
        _SHARED.reset(token)


def shared_texels(key: Callable[[str], str], read: Callable[[], np.ndarray]) -> np.ndarray:
    """What `read` returns, (H, W, C) float32; where texels are shared, under the key that `key` makes of `made_by`."""
    memory = _SHARED.get()
    if memory is None:
        return read()
    with _locked(memory.lock):
        name = key(memory.made_by)
        if (found := _from_bytes(memory.store.get(name))) is not None:
            return found
        texels = read()
        # A full disk is no reason to stop here
        with suppress(OutputError):
            memory.store.put(name, SHAPE.pack(*texels.shape) + texels.tobytes())
        return texels


def _from_bytes(data: bytes | None) -> np.ndarray | None:
    if data is None or len(data) < SHAPE.size:
        return None
    shape = SHAPE.unpack_from(data)
    values = np.frombuffer(data, dtype=np.float32, offset=SHAPE.size) if len(data) % 4 == 0 else np.empty(0)
    return values.reshape(shape).copy() if 0 < values.size == np.prod(shape, dtype=np.int64) else None


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the system's lock on a file; without one where there can be no such file."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    except OSError:
        yield
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
