"""Files of an http server by range, and nothing but what was asked for.

fsspec's own file system takes whatever a server sends: a whole file for a piece of it, another piece, more than there
is memory for, an answer of another host. Here each is an error. RFC 9110, sections 14 and 15.
"""

import asyncio
import errno
import os
import re
import ssl
import weakref
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from email.utils import parsedate_to_datetime
from time import time
from typing import Any

import aiohttp
import yarl
from fsspec.asyn import get_loop
from fsspec.implementations.http import HTTPFileSystem

from dataset_builder.remote.address import file_url, shown
from dataset_builder.remote.patience import PROGRESS, Fetch, Patience, TransientError
from dataset_builder.remote.place import EndedError

HOPS = 3
"""Redirects that are followed, all on one host."""
BUSY = {408, 425, 429, 500, 502, 503, 504}
"""Statuses after which another attempt may help."""
LOCKED = {401, 402, 403, 407, 451}
_RANGE = re.compile(r"bytes (?:(\d{1,18})-(\d{1,18})|\*)/(\d{1,18}|\*)")
NO_RANGES = ("the server sends whole files where pieces are asked for (HTTP status 200 instead of 206): serve them by "
             "one that knows ranges, such as nginx, or copy the whole dataset and read that")
CERTIFICATE = "the server's certificate is not trusted"


class StrictHttp(HTTPFileSystem):  # type: ignore[misc]  # fsspec has no types
    """The files below one address. It is not shared, and belongs to the process that made it."""

    cachable = False

    def __init__(self, address: str, patience: Patience, **options: Any):
        super().__init__(encoded=True, loop=get_loop(), **options)
        self._session: aiohttp.ClientSession | None = None
        self._address, self._patience, self._seen_ranges = address, patience, False

    async def set_session(self) -> aiohttp.ClientSession:
        """The connections, made where there are none."""
        if self._session is None:
            stall = self._patience.stall
            options = {"connector": aiohttp.TCPConnector(limit=self._patience.side_by_side), "trust_env": True,
                       "timeout": aiohttp.ClientTimeout(total=None, sock_connect=stall, sock_read=stall),
                       "auto_decompress": False, "cookie_jar": aiohttp.DummyCookieJar(), **self.client_kwargs}
            session = self._session = aiohttp.ClientSession(**options)
            weakref.finalize(self, _close, os.getpid(), session)
        return self._session

    async def receive(self, fetch: Fetch) -> None:
        """See `Fetcher.receive`."""
        try:
            async with self._answer(fetch) as answer:
                expected = self._expected(fetch, answer)
                if expected != 0:
                    await self._take(fetch, answer, expected)
        except (aiohttp.ClientSSLError, ssl.SSLError) as error:
            raise OSError(errno.EPROTO, f"{CERTIFICATE} ({type(error).__name__})") from error
        except TimeoutError as error:
            raise TransientError(f"nothing came for {self._patience.stall:g} seconds") from error
        except aiohttp.ClientPayloadError as error:
            raise TransientError(f"the answer ends after {len(fetch.data)} bytes of the piece") from error
        except aiohttp.ClientError as error:
            # What it says may hold the whole address
            said = error.strerror if isinstance(error, OSError) and error.strerror else type(error).__name__
            raise TransientError(f"the connection failed ({said})") from error

    @asynccontextmanager
    async def _answer(self, fetch: Fetch) -> AsyncIterator[aiohttp.ClientResponse]:
        """What the server answers after redirects. It is read no further than whoever asked reads it."""
        session, url = await self.set_session(), self.encode_url(file_url(self._address, fetch.name))
        headers = {**self.kwargs.get("headers", {}), "Accept-Encoding": "identity"}
        if fetch.next or fetch.end is not None:
            headers["Range"] = f"bytes={fetch.next}-{'' if fetch.end is None else fetch.end - 1}"
        for _ in range(HOPS + 1):
            answer = await session.get(url, headers=headers, allow_redirects=False)
            try:
                if answer.status not in (301, 302, 303, 307, 308):
                    yield answer
                    return
                url = _redirected(url, answer.headers.get("Location", ""))
            finally:
                # Does nothing where all was read, so that the connection is used again
                answer.close() if not answer.content.is_eof() else answer.release()
        raise OSError(errno.ELOOP, f"redirected more than {HOPS} times")

    def _expected(self, fetch: Fetch, answer: aiohttp.ClientResponse) -> int | None:
        """Bytes that follow, where that is known. Raises what an answer other than asked for means."""
        _require_status(fetch, answer)
        if (coding := answer.headers.get("Content-Encoding", "identity").lower()) not in ("", "identity"):
            self._doubt(OSError(errno.EPROTO, f"expected the file as it is, the server sends it as {coding[:20]}"))
        length = answer.content_length
        if answer.status == 206:
            size = _answered(fetch, answer.headers)
            if length not in (None, size):
                raise TransientError(f"expected {size} bytes, the server announces {length}")
            self._seen_ranges = True
            return size
        if fetch.size is not None or fetch.start:
            if length == 0:
                fetch.total = 0
                raise EndedError(fetch.piece, 0)
            self._doubt(OSError(errno.EPROTO, NO_RANGES))
        # A whole file from its start, where the rest of it was asked for
        fetch.data.clear()
        fetch.see(_mark(answer.headers), length)
        if length is not None and length > fetch.most:
            raise OSError(errno.EFBIG, f"larger than {fetch.most:,} bytes")
        return length

    def _doubt(self, error: OSError) -> None:
        """Raise what is so by nature of a server, but chance where it has answered otherwise before."""
        if self._seen_ranges:
            raise TransientError(str(error.strerror or error))
        raise error

    async def _take(self, fetch: Fetch, answer: aiohttp.ClientResponse, expected: int | None) -> None:
        before, clock = len(fetch.data), asyncio.get_running_loop().time
        marked, since = before, clock()
        async for chunk in answer.content.iter_any():
            if expected is not None and len(fetch.data) + len(chunk) - before > expected:
                raise TransientError("the server sends more than it announced")
            if len(fetch.data) + len(chunk) > fetch.most:
                raise OSError(errno.EFBIG, f"larger than {fetch.most:,} bytes")
            fetch.data += chunk
            if len(fetch.data) - marked >= PROGRESS:
                marked, since = len(fetch.data), clock()
            elif clock() - since > self._patience.stall:
                raise TransientError(f"fewer than {PROGRESS} bytes came in {self._patience.stall:g} seconds")
        if expected is not None and (got := len(fetch.data) - before) != expected:
            raise TransientError(f"expected {expected} bytes, the answer ends after {got}")


def _require_status(fetch: Fetch, answer: aiohttp.ClientResponse) -> None:
    status = answer.status
    if status in (200, 206):
        return
    if status in (404, 410):
        raise FileNotFoundError(errno.ENOENT, f"HTTP status {status}, no such file", fetch.name)
    if status in LOCKED:
        rule = f"HTTP status {status}: the server wants a password, a key or a signed address"
        raise PermissionError(errno.EACCES, rule, fetch.name)
    if status == 416:
        match = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        fetch.total = int(match[3]) if match and match[3] != "*" else None
        if fetch.total is not None and fetch.total > fetch.next:
            raise TransientError(f"the server refuses bytes from {fetch.next}, though the file has {fetch.total}")
        if fetch.size is None and fetch.data:
            raise OSError(errno.EPROTO, f"the server announced more than the {len(fetch.data)} bytes that there are")
        raise EndedError(fetch.piece, len(fetch.data))
    if status in BUSY:
        raise TransientError(f"HTTP status {status}", _asked_wait(answer.headers.get("Retry-After", "")))
    raise OSError(errno.EPROTO, f"HTTP status {status}")


def _answered(fetch: Fetch, headers: Mapping[str, str]) -> int:
    """Bytes of a piece that is the one asked for. Raises TransientError where it is not, and EndedError where the file
    ends before it does."""
    said = headers.get("Content-Range", "")
    match = _RANGE.fullmatch(said)
    if match is None or match[1] is None or int(match[1]) != fetch.next:
        raise TransientError(f"asked for bytes from {fetch.next}, the server sends {said[:60] or 'others'}")
    last, total = int(match[2]), None if match[3] == "*" else int(match[3])
    fetch.see(_mark(headers), total)
    if total is not None and last >= total:
        raise TransientError(f"the server sends {said[:60]}, which cannot be")
    if fetch.end is None:
        if total is not None and total > fetch.start + fetch.most:
            raise OSError(errno.EFBIG, f"larger than {fetch.most:,} bytes")
        return last + 1 - fetch.next
    if last + 1 == fetch.end:
        return fetch.end - fetch.next
    if total is not None and last + 1 == total < fetch.end:
        raise EndedError(fetch.piece, total - fetch.start)
    raise TransientError(f"asked for bytes up to {fetch.end - 1}, the server sends {said[:60]}")


def _mark(headers: Mapping[str, str]) -> str:
    return headers.get("ETag") or headers.get("Last-Modified") or ""


def _redirected(url: yarl.URL, location: str) -> yarl.URL:
    """Where a redirect leads. Raises OSError where that is another host, or no longer https."""
    try:
        found = url.join(yarl.URL(location, encoded=True))
        same = found.host == url.host and (found.origin() == url.origin()
                                           or (url.scheme, found.scheme) == ("http", "https"))
    except ValueError:
        same = False
    if not location or not same:
        elsewhere = shown(location)[:100] if "://" in location else location[:100]
        rule = f"the server sends its readers elsewhere, to {elsewhere or 'nowhere'}, which is not followed"
        raise OSError(errno.EPROTO, f"{rule}: give that address, if you trust it")
    return found


def _asked_wait(said: str) -> float | None:
    """Seconds that `Retry-After` asks for: a number, or a date."""
    try:
        return float(said) if said.isdecimal() else max(parsedate_to_datetime(said).timestamp() - time(), 0.0)
    except (ValueError, TypeError):
        return None


def _close(made_by: int, session: aiohttp.ClientSession) -> None:
    """Close connections, unless a fork took them along: then they are the parent's."""
    loop = get_loop() if made_by == os.getpid() else None
    if loop is not None and loop.is_running() and not session.closed:
        asyncio.run_coroutine_threadsafe(session.close(), loop)
