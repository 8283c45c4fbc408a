"""Disks that are full or cannot be written, clocks that jump, handles that run out: a reason, and a second run goes on
to the same bytes."""

import errno
import os
import resource
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from dataset_builder import builder
from dataset_builder.cli.main import main
from dataset_builder.engine import finishing
from dataset_builder.errors import OutputError, UserError
from dataset_builder.shards import staging
from tests.small_specs import contents, outcomes_of, run_build, write_spec

QUICK = ("rough.sigma=0.0", "splits.train.lights=1", "render.spp=4")
"""Three examples of three views."""
DAY = 86_400 * 10**9


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, bytes]]:
    """A spec, and the files of its dataset."""
    spec = write_spec(tmp_path_factory.mktemp("whole") / "spec")
    run_build(spec, spec.parent.parent / "out", *QUICK)
    return spec, contents(spec.parent.parent / "out")


class Disk:
    """A small file system of its own."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._ballast = folder / "ballast"

    def fill(self, left: int = 0) -> None:
        """Leave so many bytes free."""
        free = os.statvfs(self.folder)
        self._ballast.write_bytes(bytes(free.f_bavail * free.f_bsize - left))

    def free(self) -> None:
        """Let all of it go."""
        self._ballast.unlink()

    def remount(self, options: str) -> None:
        """Change how it is mounted."""
        subprocess.run(["mount", "-o", f"remount,{options}", str(self.folder)], check=True)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    """16 MiB of memory as a disk, where that may be mounted."""
    (tmp_path / "disk").mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(tmp_path / "disk")]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no file system can be mounted here")
    try:
        yield Disk(tmp_path / "disk")
    finally:
        subprocess.run(["umount", "-l", str(tmp_path / "disk")], check=True)


def before(monkeypatch: pytest.MonkeyPatch, place: object, name: str, strike: Callable[[], object],
           after: int = 0) -> None:
    """Let something happen before a function is called, after so many calls of it, once."""
    real, calls = getattr(place, name), iter(range(10**6))

    def stricken(*arguments: object, **named: object) -> object:
        if next(calls) == after:
            strike()
        return real(*arguments, **named)

    monkeypatch.setattr(place, name, stricken)


@pytest.mark.parametrize(("place", "name", "after"), [
    (staging.Staging, "put", 1), (finishing, "publish_shard", 1), (finishing, "publish_dataset", 0)])
def test_a_disk_that_fills(whole: tuple[Path, dict[str, bytes]], disk: Disk, monkeypatch: pytest.MonkeyPatch,
                           place: object, name: str, after: int) -> None:
    """While examples are staged, shards are made, or the dataset is published."""
    spec, files = whole
    with monkeypatch.context() as patch:
        before(patch, place, name, disk.fill, after)
        with pytest.raises(OutputError, match=r"the disk is full .*free some space and run the same command again"):
            run_build(spec, disk.folder / "out", *QUICK)
    assert not (disk.folder / "out" / "dataset.json").exists()
    disk.free()
    again = outcomes_of(run_build(spec, disk.folder / "out", *QUICK))
    assert contents(disk.folder / "out") == files and len(again) <= 3 and sum(not each.kept for each in
                                                                              again.values()) <= 2


def test_a_disk_that_cannot_be_written(whole: tuple[Path, dict[str, bytes]], disk: Disk) -> None:
    spec, files = whole
    run_build(spec, disk.folder / "out", *QUICK, only=[0])
    disk.remount("ro")
    with pytest.raises(OutputError, match="cannot be written"):
        run_build(spec, disk.folder / "out", *QUICK)
    disk.remount("rw")
    assert outcomes_of(run_build(spec, disk.folder / "out", *QUICK))[0].kept
    assert contents(disk.folder / "out") == files


REFUSALS = {errno.ENOSPC: "the disk is full", errno.EROFS: "cannot be written",
            errno.EMFILE: "no file can be opened any more"}


def test_what_the_system_refuses_at_any_step(whole: tuple[Path, dict[str, bytes]], tmp_path: Path,
                                             monkeypatch: pytest.MonkeyPatch) -> None:
    """Of calls that open, flush or rename a file as a dataset is put together of staged examples."""
    spec, files = whole
    run_build(spec, tmp_path / "staged", *QUICK, only=[0, 1, 2])
    steps, refused = [*(("fsync", n) for n in (0, 7, 14)), *(("replace", n) for n in (1, 6, 11)),
                      *(("open", n) for n in range(10, 60, 10))], list[str]()
    for number, (name, after) in enumerate(steps):
        code, out = list(REFUSALS)[number % 2 if name != "open" else 2], tmp_path / str(number)
        shutil.copytree(tmp_path / "staged", out)
        with monkeypatch.context() as patch:
            before(patch, os, name, partial(refuse, code), after)
            try:
                run_build(spec, out, *QUICK)
            except UserError as error:
                refused.append(name)
                # What cannot be opened for a moment may count as not there
                assert REFUSALS[code] in str(error) or name == "open"
        run_build(spec, out, *QUICK)
        assert contents(out) == files
        shutil.rmtree(out)
    # What cannot be read is as good as not there, and is made again
    assert refused.count("fsync") > 1 and refused.count("replace") > 1 and "open" in refused


def refuse(code: int) -> None:
    raise OSError(code, os.strerror(code))


def test_handles_that_run_out(whole: tuple[Path, dict[str, bytes]], tmp_path: Path,
                              monkeypatch: pytest.MonkeyPatch) -> None:
    spec, files = whole
    most = resource.getrlimit(resource.RLIMIT_NOFILE)

    def exhaust() -> None:
        # Those that are open stay
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, most[1]))

    try:
        with monkeypatch.context() as patch:
            before(patch, builder, "run_unit", exhaust, 1)
            with pytest.raises(OutputError, match=r"no file can be opened any more .*ulimit -n"):
                run_build(spec, tmp_path / "out", *QUICK)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, most)
    run_build(spec, tmp_path / "out", *QUICK)
    assert contents(tmp_path / "out") == files


@pytest.mark.parametrize("days", [-1, 1])
def test_a_clock_that_jumps_a_day(whole: tuple[Path, dict[str, bytes]], tmp_path: Path, days: int,
                                  monkeypatch: pytest.MonkeyPatch) -> None:
    spec, files = whole
    run_build(spec, tmp_path / "out", *QUICK, only=[0, 1])
    for path in [*(tmp_path / "out").rglob("*"), *spec.parent.rglob("*")]:
        moved = path.stat().st_mtime_ns + days * DAY
        os.utime(path, ns=(moved, moved))
    monkeypatch.setattr(time, "time", lambda now=time.time: now() - days * DAY / 1e9)
    again = outcomes_of(run_build(spec, tmp_path / "out", *QUICK))
    assert [again[index].kept for index in range(3)] == [True, True, False]
    assert contents(tmp_path / "out") == files


def test_no_memory_left_is_one_line(whole: tuple[Path, dict[str, bytes]], tmp_path: Path,
                                    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def exhausted(*parts: object) -> object:
        raise MemoryError

    monkeypatch.setattr(builder, "versions", exhausted)
    assert main(["build", str(whole[0]), "--out", str(tmp_path / "out"), "--workers", "1", "--backend", "llvm"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: no memory is left; finished examples are kept") and said.count("\n") == 1
    assert not (tmp_path / "out").exists()
