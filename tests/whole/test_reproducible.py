"""One spec, one set of bytes: however many processes, in whatever order, interrupted or not."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dataset_builder.engine.unit import BuildJob, run_unit
from dataset_builder.errors import SpecError
from dataset_builder.planning.catalogue import units
from dataset_builder.planning.plan import Planner
from dataset_builder.shards.folder import STAGING, WORK, next_of
from dataset_builder.shards.publish import published
from dataset_builder.shards.segment import BLOCK, end_blocks
from dataset_builder.shards.verify import verify
from dataset_builder.spec.load import load_dataset
from tests.shards.tiny_dataset import shard_path
from tests.small_specs import contents, outcomes_of, records, run_build, slots, write_spec

EVERY_FILE = {"README.md", "SHA256SUMS", "croissant.json", "dataset.json"}


def staged(folder: Path) -> list[Path]:
    """Entries of finished examples that wait for their shard."""
    return sorted((folder / WORK / STAGING).glob("*.json"))


def test_the_dataset_is_whole_and_right(small_dataset: Path) -> None:
    assert verify(small_dataset) == []
    assert slots(small_dataset) == [
        f"small-v1-{name}-{number:06d}" for name, count in (("test", 2), ("train", 4)) for number in range(count)]
    shards = [path.stem for path in (small_dataset / "shards").iterdir()]
    assert all(re.fullmatch(r"small-v1-[a-z]+-[0-9]{6}-[0-9a-f]{8}", stem) for stem in shards)
    files = {f"shards/{stem}.tar" for stem in shards} | {f"index/{stem}.manifest" for stem in shards}
    assert set(contents(small_dataset)) == EVERY_FILE | files


def test_two_processes_elsewhere_make_the_same_bytes(small_dataset: Path, tmp_path: Path) -> None:
    run_build(write_spec(tmp_path / "spec"), tmp_path / "out", workers=2)
    assert contents(tmp_path / "out") == contents(small_dataset)


def test_an_example_alone_and_a_build_that_goes_on_from_it(small_spec: Path, small_dataset: Path,
                                                           tmp_path: Path) -> None:
    alone = run_build(small_spec, tmp_path, only=[7, 2])
    assert [event.wanted for event in alone[:1]] == [2] and not (tmp_path / "shards").exists()
    assert [json.loads(path.read_bytes())["entry"]["key"] for path in staged(tmp_path)] == ["00000002", "00000007"]
    for path in staged(tmp_path):
        assert path.with_suffix(".segment").read_bytes() == segment_in_shard(small_dataset, path.name.partition(".")[0])

    rest = outcomes_of(run_build(small_spec, tmp_path))
    assert [index for index, outcome in sorted(rest.items()) if outcome.kept] == [2, 7] and len(rest) == 10
    assert contents(tmp_path) == contents(small_dataset)
    assert list((tmp_path / WORK / STAGING).iterdir()) == []


def segment_in_shard(folder: Path, key: str) -> bytes:
    """The bytes of one example where they lie in its shard."""
    for path in sorted((folder / "shards").iterdir()):
        index, data = published(folder, path.stem), path.read_bytes()
        assert index is not None
        starts = [example.members[0].offset - BLOCK for example in index.examples]
        last = index.examples[-1].members[-1]
        end = last.offset + last.size + -last.size % BLOCK
        assert data[end:] == end_blocks(end)
        for example, start, stop in zip(index.examples, starts, [*starts[1:], end], strict=True):
            if example.key == key:
                return data[start:stop]
    raise AssertionError(key)


def test_a_build_that_was_killed_goes_on(small_spec: Path, small_dataset: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dataset_builder", "build", str(small_spec), "--out", str(tmp_path / "out"),
               "--workers", "1", "--backend", "llvm"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=Path(__file__).parents[2]) as process:
        deadline = time.monotonic() + 60
        while len(staged(tmp_path / "out")) < 2 and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert contents(tmp_path / "out") == {}

    waiting = len(list((next_of(tmp_path / "out") / "index").glob("*.manifest")))
    rest = outcomes_of(run_build(small_spec, tmp_path / "out"))
    assert sum(outcome.kept for outcome in rest.values()) + 3 * waiting >= 2
    assert contents(tmp_path / "out") == contents(small_dataset)


@pytest.fixture
def copy(small_dataset: Path, tmp_path: Path) -> Path:
    """The small dataset, to be changed."""
    for name, data in contents(small_dataset).items():
        (tmp_path / "copy" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "copy" / name).write_bytes(data)
    return tmp_path / "copy"


def test_a_finished_dataset_is_kept(small_spec: Path, small_dataset: Path, copy: Path) -> None:
    times = {path: path.stat().st_mtime_ns for path in (copy / "shards").iterdir()}
    events = run_build(small_spec, copy)
    assert events[0].wanted == 0 and outcomes_of(events) == {}
    assert {path: path.stat().st_mtime_ns for path in (copy / "shards").iterdir()} == times
    assert contents(copy) == contents(small_dataset)


def test_only_a_damaged_shard_is_made_again(small_spec: Path, small_dataset: Path, copy: Path) -> None:
    path = shard_path(copy, "small-v1-train-000001")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert sorted(outcomes_of(run_build(small_spec, copy))) == [2, 3]
    assert contents(copy) == contents(small_dataset)


def test_another_spec_replaces_every_shard_and_leaves_no_other(small_spec: Path, copy: Path) -> None:
    events = run_build(small_spec, copy, "rough.sigma=0.0", "storage.examples_per_shard=8", "splits.train.lights=1")
    assert sorted(outcomes_of(events)) == [0, 1, 2] and verify(copy) == []
    assert slots(copy) == ["small-v1-test-000000", "small-v1-train-000000", "small-v1-train-000001"]
    assert len(records(copy)) == 3


def test_a_spec_that_changes_under_a_build_is_refused(tmp_path: Path) -> None:
    spec = write_spec(tmp_path)
    loaded = load_dataset(spec)
    job = BuildJob.of(loaded, tmp_path / "out", backend="llvm", threads=1)
    write_spec(tmp_path, {"rooms/den.yaml": "width: 5\n"})
    with pytest.raises(SpecError, match=r"small\.yaml: expected the spec that the build started with"):
        run_unit(job, units(Planner(loaded).examples)[0])
    assert not (tmp_path / "out").exists()


def test_ctrl_c_ends_a_build_at_once_whatever_its_processes_do(tmp_path: Path) -> None:
    # What runs in the background of a shell ignores Ctrl-C, and so do its children
    script = ("import signal\nimport time\nfrom dataset_builder.engine.local import run\n"
              "if __name__ == '__main__':\n"
              "    signal.signal(signal.SIGINT, signal.default_int_handler)\n"
              "    for _ in run(time.sleep, [0, 0, 600, 600, 600, 600], workers=2):\n"
              "        print('ready', flush=True)\n")
    (tmp_path / "pool.py").write_text(script)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, str(tmp_path / "pool.py")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment) as pool:
        assert pool.stdout is not None and [pool.stdout.readline(), pool.stdout.readline()] == [b"ready\n"] * 2
        pool.send_signal(signal.SIGINT)
        try:
            pool.wait(20)
        finally:
            pool.kill()
    assert pool.returncode == -signal.SIGINT


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="processes are looked up in /proc")
def test_processes_end_with_a_parent_that_was_killed(tmp_path: Path) -> None:
    script = ("import time\nfrom dataset_builder.engine.local import run\n"
              "if __name__ == '__main__':\n"
              "    for _ in run(time.sleep, [0, 0, 60, 60], workers=2):\n        print('ready', flush=True)\n")
    (tmp_path / "pool.py").write_text(script)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    with subprocess.Popen([sys.executable, str(tmp_path / "pool.py")], stdout=subprocess.PIPE, env=environment) as pool:
        assert pool.stdout is not None and pool.stdout.readline() == b"ready\n"
        children = children_of(pool.pid)
        assert len(children) >= 2
        pool.send_signal(signal.SIGKILL)
        pool.wait()
    deadline = time.monotonic() + 10
    while any(map(alive, children)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(alive, children))


def state(process: int) -> tuple[str, int]:
    """State and parent of a process; Z where it is gone."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return "Z", 0
    return fields[0], int(fields[1])


def alive(process: int) -> bool:
    """Whether a process still runs; one that only nobody asked after does not."""
    return state(process)[0] != "Z"


def children_of(parent: int) -> list[int]:
    """Processes whose parent is `parent`."""
    return [child for path in Path("/proc").glob("[0-9]*") if state(child := int(path.name))[1] == parent]
