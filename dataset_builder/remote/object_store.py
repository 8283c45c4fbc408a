"""Files in S3, in Google's storage and on Hugging Face's hub, by the file systems that fsspec has for them.

Those try again by themselves where a connection fails. What they return is measured here, and too little of it is
asked for again.
"""

import asyncio
import errno
from typing import Any

import fsspec

from dataset_builder.remote.address import said
from dataset_builder.remote.patience import Fetch, Patience, TransientError
from dataset_builder.remote.place import EndedError

SLOWEST = 1 << 16
"""Bytes per second that are waited for, beyond `Patience.stall`."""
MARKS = ("ETag", "etag", "blob_id", "oid", "LastModified", "mtime")
"""What tells one version of a file from another, as the file systems call it."""


class ObjectStore:
    """The files below one address. It belongs to the process that made it."""

    def __init__(self, address: str, patience: Patience):
        self._patience = patience
        scheme, _, root = address.partition("://")
        # Settings, such as S3's endpoint, are fsspec's own: https://filesystem-spec.readthedocs.io, Configuration
        self._files = fsspec.filesystem(scheme.lower(), skip_instance_cache=True, use_listings_cache=False)
        self._root = root.rstrip("/")

    async def receive(self, fetch: Fetch) -> None:
        """See `Fetcher.receive`."""
        if fetch.size is None or fetch.pinned or fetch.head:
            await self._see(fetch)
            if fetch.head:
                return
        end = fetch.total if fetch.end is None else fetch.end
        assert end is not None
        if end > fetch.next:
            data = await self._asked(self._call("cat_file", fetch.name, start=fetch.next, end=end), fetch, end)
            fetch.data += data[:end - fetch.next]
        if fetch.next < end:
            await self._see(fetch)
            if fetch.total is not None and fetch.total < end:
                raise EndedError(fetch.piece, max(fetch.total - fetch.start, 0))
            raise TransientError(f"expected {end - fetch.start} bytes, the answer ends after {len(fetch.data)}")

    async def _see(self, fetch: Fetch) -> None:
        """Size and version of the file."""
        found = await self._asked(self._call("info", fetch.name), fetch, fetch.next)
        if found.get("type") != "file":
            raise FileNotFoundError(errno.ENOENT, "no such file", fetch.name)
        fetch.see(next((str(found[mark]) for mark in MARKS if found.get(mark)), ""), int(found["size"]))
        if fetch.size is None and int(found["size"]) > fetch.most:
            raise OSError(errno.EFBIG, f"larger than {fetch.most:,} bytes")
        if fetch.size is not None and fetch.start >= int(found["size"]):
            raise EndedError(fetch.piece, 0)

    def _call(self, method: str, name: str, **options: Any) -> Any:
        path = f"{self._root}/{name}"
        if self._files.async_impl:
            return getattr(self._files, f"_{method}")(path, **options)
        if method == "cat_file":
            # Nothing beyond what is asked for
            options["cache_type"] = "none"
        return asyncio.to_thread(getattr(self._files, method), path, **options)

    async def _asked(self, answer: Any, fetch: Fetch, end: int) -> Any:
        limit = self._patience.stall + (end - fetch.next) / SLOWEST
        try:
            return await asyncio.wait_for(answer, limit)
        except FileNotFoundError as error:
            raise FileNotFoundError(errno.ENOENT, "no such file", fetch.name) from error
        except PermissionError as error:
            rule = f"no permission ({said(error)}): it wants a key"
            raise PermissionError(errno.EACCES, rule, fetch.name) from error
        except TimeoutError as error:
            raise TransientError(f"no answer within {limit:.0f} seconds") from error
        except Exception as error:
            # What these libraries raise has no common class
            if type(error).__name__ == "ParamValidationError":
                raise OSError(errno.EINVAL, "the library takes it for no bucket and path", fetch.name) from error
            if "credentials" in type(error).__name__.lower():
                raise PermissionError(errno.EACCES, "no credentials: it wants a key", fetch.name) from error
            raise TransientError(said(error)) from error
