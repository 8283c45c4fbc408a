"""A lease: one owner at a time, dead ones replaced, whatever the clocks and the file system."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import pytest

from dataset_builder import lease
from dataset_builder.errors import OutputError
from dataset_builder.lease import Lease, held
from dataset_builder.lock import locked

ROOT = Path(__file__).parent.parent
IGNORED = list[str]()
QUICK = "from dataset_builder import lease\nlease.RENEW, lease.LAPSE, lease.LOOK = 0.1, 1.5, 0.05\n"
ELSEWHERE = QUICK + "lease.machine = lambda: {{'host': '{host}', 'boot': 'x', 'pids': 'y'}}\n"
HOLD = """
import sys
from pathlib import Path
from dataset_builder.errors import OutputError
from dataset_builder.lease import held
path = Path(sys.argv[1])
try:
    with held(path, folder=path, work='build') as mine:
        print('held', mine.number, flush=True)
        sys.stdin.readline()
        mine.require()
        print('done', flush=True)
except OutputError as error:
    print(error, flush=True)
"""


@contextmanager
def process(script: str, path: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that runs a script; ended afterwards."""
    with subprocess.Popen([sys.executable, "-c", script, str(path)], text=True, cwd=ROOT, stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE) as started:
        try:
            yield started
        finally:
            started.kill()


def line(of: subprocess.Popen[str]) -> str:
    assert of.stdout is not None
    return of.stdout.readline().strip()


def go(on: subprocess.Popen[str]) -> None:
    assert on.stdin is not None
    on.stdin.write("\n")
    on.stdin.flush()


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times of a test."""
    for name, value in (("RENEW", 0.1), ("LAPSE", 1.5), ("LOOK", 0.05)):
        monkeypatch.setattr(lease, name, value)


def test_here_the_living_are_left_alone_at_once_and_the_dead_replaced_at_once(tmp_path: Path) -> None:
    """With the real times: nothing is waited for."""
    told = list[str]()
    with process(HOLD, tmp_path / "lease") as holder:
        assert line(holder) == "held 1"
        refused = pytest.raises(OutputError, match=rf"another build is running in this folder \(process {holder.pid}\)")
        holder.send_signal(signal.SIGSTOP)
        with refused, held(tmp_path / "lease", folder=tmp_path, work="build"):
            pass
        holder.kill()
        holder.wait()
        with held(tmp_path / "lease", folder=tmp_path, work="build", told=told.append) as mine:
            assert mine.number == 2
    assert told == [f"note: took over {tmp_path} from process {holder.pid}, which is dead"]
    with held(tmp_path / "lease", folder=tmp_path, work="build", told=told.append):
        assert len(told) == 1


def test_a_process_of_the_same_number_is_not_taken_for_the_owner(tmp_path: Path,
                                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    mine = Lease(tmp_path, 1, tmp_path, "build")
    with monkeypatch.context() as patch:
        patch.setattr(lease, "started", lambda pid: "some other time")
        assert mine.take()
    with held(tmp_path, folder=tmp_path, work="build", told=IGNORED.append) as other:
        assert other.number == 2
    mine.end()


def test_elsewhere_the_living_are_heard_and_the_dead_replaced_after_a_time(tmp_path: Path, quick: None) -> None:
    told = list[str]()
    with process(ELSEWHERE.format(host="far") + HOLD, tmp_path / "lease") as holder:
        assert line(holder) == "held 1"
        refused = pytest.raises(OutputError, match=rf"process {holder.pid} on far\)")
        with refused, held(tmp_path / "lease", folder=tmp_path, work="build", told=told.append):
            pass
        assert told == [f"note: process {holder.pid} on far holds {tmp_path}; waiting up to 1.5 s for a sign of life"]
        holder.kill()
        holder.wait()
        with held(tmp_path / "lease", folder=tmp_path, work="build", told=told.append) as mine:
            assert mine.number == 2
        assert told[-1].endswith("on far, which gave no sign of life for 1.5 s")


def test_of_two_that_wait_for_a_dead_owner_one_wins(tmp_path: Path) -> None:
    with process(ELSEWHERE.format(host="far") + HOLD, tmp_path) as holder:
        assert line(holder) == "held 1"
        holder.kill()
        holder.wait()
    with process(ELSEWHERE.format(host="a") + HOLD, tmp_path) as one, \
            process(ELSEWHERE.format(host="b") + HOLD, tmp_path) as two:
        refused, held_by = sorted(line(taker) for taker in (one, two))
        assert refused.startswith(f"{tmp_path}: another build is running in this folder (process")
        assert held_by == "held 2"


def test_an_owner_that_was_stopped_sees_that_it_lost(tmp_path: Path, quick: None) -> None:
    with process(ELSEWHERE.format(host="laptop") + HOLD, tmp_path) as holder:
        assert line(holder) == "held 1"
        holder.send_signal(signal.SIGSTOP)
        with held(tmp_path, folder=tmp_path, work="build", told=IGNORED.append) as mine:
            holder.send_signal(signal.SIGCONT)
            go(holder)
            assert "stood still for over 1.5 s and another took its place" in line(holder)
            mine.require()
        assert [path.name for path in sorted(tmp_path.iterdir())] == ["00000001", "00000002", "00000003"]


def test_an_owner_goes_on_to_other_numbers_and_leaves_few_files(tmp_path: Path) -> None:
    with held(tmp_path, folder=tmp_path, work="build") as mine:
        for _ in range(9):
            mine.require()
        assert mine.number == 10
        assert [path.name for path in sorted(tmp_path.iterdir())] == [f"{number:08d}" for number in (7, 8, 9, 10)]
        # A taker that fell asleep before it created what was the next number then
        late = Lease(tmp_path, 2, tmp_path, "build")
        assert not late.take() and not (tmp_path / "00000002").exists()
        mine.require()


def test_a_number_whose_owner_died_before_it_wrote_is_taken_over(tmp_path: Path, quick: None) -> None:
    (tmp_path / "00000005").touch()
    with held(tmp_path, folder=tmp_path, work="build", told=IGNORED.append) as mine:
        assert mine.number == 6


@pytest.mark.parametrize("code", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_has_one_owner_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                               code: int, quick: None) -> None:
    def refuse(descriptor: int, how: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(fcntl, "flock", refuse)
    order = list[str]()

    def second() -> None:
        with locked(tmp_path / "lock", folder=tmp_path, work="making", wait=True):
            order.append("second")

    waiting = Thread(target=second)
    with locked(tmp_path / "lock", folder=tmp_path, work="making"):
        with pytest.raises(OutputError, match="another making is running"), \
                locked(tmp_path / "lock", folder=tmp_path, work="making"):
            pass
        waiting.start()
        waiting.join(0.2)
        order.append("first")
    waiting.join(10)
    assert order == ["first", "second"] and not (tmp_path / "lock").exists()
