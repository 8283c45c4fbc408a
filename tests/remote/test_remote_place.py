"""Files at addresses: equal bytes whatever a server does, or a reason; and never more than was asked for."""

import os
import pickle
import signal
import socket
import threading
import warnings
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from time import monotonic

import pytest

from dataset_builder.digest import sha256_bytes
from dataset_builder.remote.open_place import place_of
from dataset_builder.remote.patience import Patience
from dataset_builder.remote.place import ByteRange, EndedError, FolderPlace
from dataset_builder.seeding import rng
from tests.fault_proxy import FAULTS, Fault, Plan, fault_proxy, running
from tests.file_servers import KEYS, needs_nginx, nginx_server, range_server, s3_server

QUICK = Patience(attempts=4, stall=0.3, first=0.001, longest=0.01)
SIZE = 300_000
PIECES = [ByteRange("shards/a.tar", 7, 100_000), ByteRange("empty", 0, 0), ByteRange("b c.txt", 0, 3),
          ByteRange("shards/a.tar", SIZE - 1, 1)]
HONEST: tuple[Fault, ...] = ("truncated", "shifted", "whole", "error", "busy", "stall", "reset")
"""Faults that a place mends by itself: the bytes are right, or are not taken."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of three files."""
    found = tmp_path_factory.mktemp("place") / "data"
    (found / "shards").mkdir(parents=True)
    (found / "shards" / "a.tar").write_bytes(rng(0, "bytes").bytes(SIZE))
    (found / "b c.txt").write_bytes(b"abc")
    (found / "empty").write_bytes(b"")
    return found


@pytest.fixture(scope="module", params=["python", pytest.param("nginx", marks=needs_nginx)])
def server(request: pytest.FixtureRequest, folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server of it."""
    tmp = tmp_path_factory.mktemp("server")
    with range_server(folder) if request.param == "python" else nginx_server(folder, tmp) as address:
        yield address


def test_a_place_at_an_address_is_as_a_folder(server: str, folder: Path) -> None:
    here, there = FolderPlace(folder), place_of(server + "/", patience=QUICK)
    assert there.ranges(PIECES) == here.ranges(PIECES)
    assert b"".join(there.stream("shards/a.tar", start=5)) == b"".join(here.stream("shards/a.tar", start=5))
    for name in ("shards/a.tar", "b c.txt", "empty"):
        assert there.size(name) == here.size(name)
        assert there.read(name, most=SIZE) == here.read(name, most=SIZE)
    with pytest.raises(OSError, match="larger than 299,999 bytes"):
        there.read("shards/a.tar", most=SIZE - 1)
    for place in (here, there):
        with pytest.raises(EndedError, match="expected 10 bytes from byte 299995, the file ends after 5"):
            place.ranges([PIECES[0], ByteRange("shards/a.tar", SIZE - 5, 10)])
        with pytest.raises(EndedError):
            place.ranges([ByteRange("shards/a.tar", SIZE + 5, 10)])
        with pytest.raises(FileNotFoundError):
            place.read("none", most=1)


@pytest.mark.parametrize("fault", HONEST)
def test_faults_cost_time_and_no_byte(folder: Path, fault: Fault) -> None:
    """Two in a row for every range of every file; then the third attempt, or the rest of the first two."""
    plan = Plan(faults=[fault], after=1)
    with range_server(folder) as upstream, fault_proxy(upstream, plan) as address:
        place = place_of(address, patience=QUICK)
        assert place.size("b c.txt") == 3
        assert place.ranges(PIECES) == FolderPlace(folder).ranges(PIECES)
        assert place.read("shards/a.tar", most=SIZE) == (folder / "shards" / "a.tar").read_bytes()
        assert b"".join(place.stream("shards/a.tar")) == (folder / "shards" / "a.tar").read_bytes()
    assert {one.fault for one in plan.served} == {None, fault}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_server_that_never_does_right_is_given_up_with_a_reason(folder: Path, fault: Fault) -> None:
    reasons = {"truncated": "the answer ends after", "shifted": "the server sends bytes 1-", "whole": "instead of 206",
               "error": "HTTP status 503", "busy": "HTTP status 429", "stall": "nothing came for 0.3 seconds",
               "reset": "the answer ends after|the connection failed",
               "bomb": "sends it as gzip", "elsewhere": "elsewhere.invalid",
               "endless": r"announces 1099511627776"}
    plan = Plan(faults=[fault], in_a_row=99)
    begin = monotonic()
    with range_server(folder) as upstream, fault_proxy(upstream, plan) as address:
        place = place_of(f"{address}/?key=secret".replace("//", "//me:secret@"), patience=QUICK)
        if fault in ("flipped", "changed"):
            # For digests to find
            assert place.ranges([ByteRange("shards/a.tar", 0, 10_000)]) != [bytes(10_000)]
            return
        with pytest.raises(OSError, match=reasons[fault]) as caught:
            place.ranges([ByteRange("shards/a.tar", 0, 10_000)])
    assert "secret" not in str(caught.value) and f"{address}/shards/a.tar" in str(caught.value)
    assert monotonic() - begin < 20
    patient = fault not in ("whole", "bomb", "elsewhere")
    assert ("tried 4 times" in str(caught.value)) == patient


def test_no_more_is_fetched_than_was_asked_for(folder: Path) -> None:
    plan = Plan(rate=0.0)
    with range_server(folder) as upstream, fault_proxy(upstream, plan) as address:
        place_of(address).ranges(PIECES)
        assert plan.sent == sum(piece.size for piece in PIECES)
        assert place_of(address).size("shards/a.tar") == SIZE
        assert plan.sent == sum(piece.size for piece in PIECES) + 1


def test_a_file_that_changes_while_it_is_read_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dataset_builder.remote.remote_place.STREAM_BYTES", 1000)
    (tmp_path / "a").write_bytes(bytes(5000))
    with range_server(tmp_path) as address:
        pieces = place_of(address, patience=QUICK).stream("a")
        assert next(pieces) == bytes(1000)
        (tmp_path / "a").write_bytes(bytes(6000))
        with pytest.raises(OSError, match="changed meanwhile"):
            list(pieces)


def test_servers_without_ranges_are_named_and_not_read_to_memory(folder: Path) -> None:
    with range_server(folder, ranges=False) as upstream, fault_proxy(upstream, plan := Plan(rate=0.0)) as address:
        place = place_of(address, patience=QUICK)
        with pytest.raises(OSError, match="serve them by one that knows ranges"):
            place.ranges([ByteRange("shards/a.tar", 0, 10)])
        assert len(plan.served) <= 1
        assert place.read("b c.txt", most=10) == b"abc"


def test_a_server_that_announces_more_than_there_is_is_named() -> None:
    class Liar(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(416 if "Range" in self.headers else 200)
            self.send_header("Content-Range", "bytes */3")
            self.send_header("Content-Length", "0" if "Range" in self.headers else "9")
            self.end_headers()
            self.wfile.write(b"" if "Range" in self.headers else b"abc")

        def log_message(self, *_: object) -> None:
            pass

    with running(Liar) as address, pytest.raises(OSError, match="announced more than the 3 bytes that there are"):
        place_of(address, patience=QUICK).read("a", most=100)


def test_places_travel_to_other_processes(server: str, folder: Path) -> None:
    """By a pickle, and by a fork, after which both go on with connections of their own."""
    place = place_of(server)
    assert pickle.loads(pickle.dumps(place)) == place
    expected = place.ranges(PIECES)
    assert pickle.loads(pickle.dumps(place)).ranges(PIECES) == expected
    read, write = os.pipe()
    with warnings.catch_warnings():
        # That is what is tested
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if not child:
        os.write(write, sha256_bytes(b"".join(place.ranges(PIECES))).encode())
        os._exit(0)
    assert os.read(read, 64).decode() == sha256_bytes(b"".join(expected))
    assert os.waitpid(child, 0)[1] == 0
    assert place.ranges(PIECES) == expected
    os.close(read)
    os.close(write)


@pytest.mark.parametrize("name", ["../a", "/etc/passwd", "a//b", "a/./b", "a\0b", "..\\a", "", "a" * 2000])
def test_names_stay_inside(server: str, name: str) -> None:
    with pytest.raises(OSError, match="inside the folder"):
        place_of(server).read(name, most=10)


def test_paths_and_file_addresses_are_folders(tmp_path: Path) -> None:
    spaced = tmp_path / "a b"
    assert place_of(spaced) == place_of(str(spaced)) == place_of(f"file://{spaced}".replace(" ", "%20"))
    assert place_of("hf://datasets/me/set@v1.0").title == "hf://datasets/me/set@v1.0"
    assert place_of("https://me:secret@example.org/a?key=secret").title == "https://example.org/a"


def test_nobody_there_is_an_error_soon() -> None:
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        with pytest.raises(OSError, match=r"the connection failed .*; tried 4 times: try again later: .http://127.0.0.1:"):
            place_of(f"http://127.0.0.1:{held.getsockname()[1]}/a", patience=QUICK).size("b")


def test_s3(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)
    with s3_server(folder, "bucket") as address:
        monkeypatch.setenv("AWS_ENDPOINT_URL", address)
        here, there = FolderPlace(folder), place_of("s3://bucket/", patience=QUICK)
        assert there.ranges(PIECES) == here.ranges(PIECES)
        assert b"".join(there.stream("shards/a.tar", start=5)) == b"".join(here.stream("shards/a.tar", start=5))
        assert there.size("empty") == 0 and there.size("shards/a.tar") == SIZE
        assert there.read("b c.txt", most=3) == b"abc" and there.read("empty", most=3) == b""
        with pytest.raises(OSError, match="larger than 299,999 bytes"):
            there.read("shards/a.tar", most=SIZE - 1)
        with pytest.raises(EndedError):
            there.ranges([ByteRange("shards/a.tar", SIZE - 5, 10)])
        with pytest.raises(FileNotFoundError, match="no such file: 's3://bucket/none'"):
            there.read("none", most=1)


def test_ctrl_c_ends_a_request_at_once(folder: Path) -> None:
    plan = Plan(faults=["stall"], in_a_row=99)
    with range_server(folder) as upstream, fault_proxy(upstream, plan) as address:
        place, begin = place_of(address), monotonic()
        # Tests that a shell runs in the background begin with Ctrl-C ignored
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        try:
            with pytest.raises(KeyboardInterrupt):
                place.read("shards/a.tar", most=SIZE)
            timer.join()
        finally:
            signal.signal(signal.SIGINT, before)
        assert monotonic() - begin < 15
        plan.rate = 0.0
        assert place.read("b c.txt", most=3) == b"abc"
