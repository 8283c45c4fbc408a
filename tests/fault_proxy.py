"""A proxy before a file server that does wrong by plan: what networks, caches and servers do to those who read."""

import gzip
import http.client
import re
import socket
import struct
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Literal, get_args

from dataset_builder.seeding import rng

Fault = Literal["truncated", "shifted", "flipped", "whole", "error", "busy", "stall", "reset", "changed", "bomb",
                "elsewhere", "endless"]
FAULTS: tuple[Fault, ...] = get_args(Fault)
"""truncated: ends in the middle; shifted: the next piece, and says so; flipped: another byte; whole: 200 for a range;
error: 503; busy: 429, to wait no time; stall: nothing after the middle; reset: the connection, in the middle; changed:
another version; bomb: gzip of zeros; elsewhere: a redirect to another host; endless: never stops."""
ELSEWHERE = "http://elsewhere.invalid/here"
ZEROS = gzip.compress(bytes(1 << 24))


@dataclass(frozen=True, kw_only=True)
class Served:
    """One request and what was answered."""

    path: str
    range: str
    fault: Fault | None
    status: int
    sent: int
    """Bytes of the body."""


@dataclass(kw_only=True)
class Plan:
    """Which requests go wrong, and how. Every piece of a file goes wrong at most `in_a_row` times, then never again;
    pieces with one end are one, so that what is left of a piece counts as it."""

    faults: Sequence[Fault] = FAULTS
    rate: float = 1.0
    """Share of the requests that may go wrong."""
    in_a_row: int = 2
    only: str = ""
    """Pattern that paths must contain to go wrong; all where empty."""
    after: int = 0
    """Requests that are answered rightly first."""
    seed: int = 0
    _served: list[Served] = field(default_factory=list)
    _asked: Counter[str] = field(default_factory=Counter)
    _open: int = 0
    _lock: threading.Condition = field(default_factory=threading.Condition)

    def fault(self, path: str, wanted: str) -> Fault | None:
        """What becomes of a request."""
        with self._lock:
            request = f"{path} {wanted.rpartition('-')[2]}"
            number = self._asked[request]
            self._asked[request] += 1
            draws = rng(self.seed, request, number)
            early = sum(self._asked.values()) <= self.after
            if early or number >= self.in_a_row or draws.uniform() >= self.rate or not re.search(self.only, path):
                return None
            return self.faults[int(draws.integers(len(self.faults)))]

    @contextmanager
    def serving(self) -> Iterator[list[Served]]:
        """While a request is answered; what is put into the list is kept."""
        found = list[Served]()
        with self._lock:
            self._open += 1
        try:
            yield found
        finally:
            with self._lock:
                self._open -= 1
                self._served += found
                self._lock.notify_all()

    @property
    def served(self) -> list[Served]:
        """What was asked for, in the order of the answers, of which readers may know the last before their server."""
        with self._lock:
            self._lock.wait_for(lambda: not self._open, timeout=10)
            return list(self._served)

    @property
    def sent(self) -> int:
        """Bytes of all bodies."""
        return sum(one.sent for one in self.served)


@contextmanager
def fault_proxy(upstream: str, plan: Plan) -> Iterator[str]:
    """The address of a proxy before the server at `upstream` (http://HOST:PORT), until the block ends."""
    with running(partial(_Proxy, upstream.removeprefix("http://").rstrip("/"), plan)) as address:
        yield address


@contextmanager
def running(handler: object) -> Iterator[str]:
    """The address of a server of this process whose requests `handler` answers."""
    server = _Server(("127.0.0.1", 0), handler)  # type: ignore[arg-type]
    thread = threading.Thread(target=partial(server.serve_forever, poll_interval=0.02))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.ending.set()
        server.shutdown()
        thread.join()
        server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = 128

    def __init__(self, *arguments: object):
        super().__init__(*arguments)  # type: ignore[arg-type]
        self.ending = threading.Event()

    def handle_error(self, request: object, client_address: object) -> None:
        """Readers that go away are what is tested."""


class _Proxy(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: _Server

    def __init__(self, upstream: str, plan: Plan, *arguments: object):
        self.upstream, self.plan = upstream, plan
        super().__init__(*arguments)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Pass a request on, and answer it rightly or wrongly."""
        with self.plan.serving() as served:
            served.append(self._serve())

    def _serve(self) -> Served:
        wanted = self.headers.get("Range", "")
        fault = self.plan.fault(self.path, wanted)
        status, headers, body = self._upstream({"Range": wanted} if wanted and fault != "whole" else {})
        if fault == "shifted" and wanted:
            # The piece that follows by a byte
            status, headers, body = self._upstream({"Range": _moved(wanted)})
        sent = getattr(self, f"_{fault}")(status, headers, body) if fault else self._answer(status, headers, body)
        return Served(path=self.path, range=wanted, fault=fault, status=status, sent=sent)

    def _upstream(self, headers: dict[str, str]) -> tuple[int, dict[str, str], bytes]:
        connection = http.client.HTTPConnection(self.upstream, timeout=30)
        try:
            connection.request("GET", self.path, headers=headers)
            answer = connection.getresponse()
            kept = ("Content-Range", "ETag", "Last-Modified", "Content-Type", "Location", "Accept-Ranges")
            return answer.status, {name: answer.headers[name] for name in kept if answer.headers[name]}, answer.read()
        finally:
            connection.close()

    def _answer(self, status: int, headers: dict[str, str], body: bytes, *, most: int | None = None) -> int:
        self.send_response(status)
        for name, value in {"Content-Length": str(len(body)), **headers}.items():
            self.send_header(name, value)
        self.end_headers()
        part = body[:most]
        self.wfile.write(part)
        self.wfile.flush()
        return len(part)

    def _truncated(self, status: int, headers: dict[str, str], body: bytes) -> int:
        self.close_connection = True
        return self._answer(status, headers, body, most=len(body) // 2)

    def _shifted(self, status: int, headers: dict[str, str], body: bytes) -> int:
        return self._answer(status, headers, body)

    def _flipped(self, status: int, headers: dict[str, str], body: bytes) -> int:
        return self._answer(status, headers, body[:-1] + bytes([body[-1] ^ 1]) if body else body)

    def _whole(self, status: int, headers: dict[str, str], body: bytes) -> int:
        return self._answer(status, headers, body)

    def _error(self, status: int, headers: dict[str, str], body: bytes) -> int:
        return self._answer(503, {}, b"no")

    def _busy(self, status: int, headers: dict[str, str], body: bytes) -> int:
        return self._answer(429, {"Retry-After": "0"}, b"later")

    def _stall(self, status: int, headers: dict[str, str], body: bytes) -> int:
        sent = self._answer(status, headers, body, most=len(body) // 2)
        self.close_connection = True
        self.connection.settimeout(0.05)
        while not self.server.ending.is_set():
            try:
                if not self.connection.recv(1):
                    break
            except TimeoutError:
                continue
        return sent

    def _reset(self, status: int, headers: dict[str, str], body: bytes) -> int:
        sent = self._answer(status, headers, body, most=len(body) // 2)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.close_connection = True
        return sent

    def _changed(self, status: int, headers: dict[str, str], body: bytes) -> int:
        return self._answer(status, {**headers, "ETag": '"another"'}, bytes(byte ^ 255 for byte in body))

    def _bomb(self, status: int, headers: dict[str, str], body: bytes) -> int:
        self.close_connection = True
        return self._answer(200, {"Content-Encoding": "gzip"}, ZEROS)

    def _elsewhere(self, status: int, headers: dict[str, str], body: bytes) -> int:
        return self._answer(302, {"Location": ELSEWHERE}, b"")

    def _endless(self, status: int, headers: dict[str, str], body: bytes) -> int:
        self.close_connection = True
        sent = self._answer(status, {**headers, "Content-Length": str(1 << 40)}, body)
        while not self.server.ending.is_set():
            self.wfile.write(bytes(1 << 16))
            sent += 1 << 16
        return sent

    def log_message(self, *_: object) -> None:
        """Keep quiet."""


def _moved(wanted: str) -> str:
    first, last = wanted.removeprefix("bytes=").split("-")
    return f"bytes={int(first) + 1}-{int(last) + 1 if last else ''}"
