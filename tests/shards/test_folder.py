import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dataset_builder import lease
from dataset_builder.errors import OutputError
from dataset_builder.files import require_space, write_atomic
from dataset_builder.shards.folder import Claim, require_ours
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.verify import verify
from tests.shards.tiny_dataset import build

TINY = Claim(name="tiny", version="1.0.0")
HOLD = ("import sys, time; from pathlib import Path; from dataset_builder.shards.folder import Claim\n"
        "from dataset_builder.shards.one_writer import build_lock\n"
        "with build_lock(Path(sys.argv[1]), Claim(name='tiny', version='1.0.0')):\n"
        "    print('held', flush=True)\n    time.sleep(60)\n")


def test_the_second_build_refuses_and_names_the_first_until_it_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLD, str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=Path(__file__).parents[2]) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
        refusal = pytest.raises(OutputError, match=rf"another build is running in this folder \(process {holder.pid}\)")
        with refusal, build_lock(tmp_path / "out", TINY):
            pytest.fail("two builds in one folder")
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    with build_lock(tmp_path / "out", TINY):
        pass


def test_a_lock_leaves_nothing_behind(tmp_path: Path) -> None:
    for _ in range(2):
        refusal = pytest.raises(OutputError, match=f"process {os.getpid()}")
        with build_lock(tmp_path / "out", TINY), refusal, build_lock(tmp_path / "out", TINY):
            pytest.fail("two builds in one folder")
        # Of a lease its last number stays, so that none is given twice
        files = [path for path in (tmp_path / "out" / ".build").rglob("*") if path.is_file()]
        assert {path.name for path in files} >= {"claim.json"} and len(files) <= 1 + lease.KEPT


def test_a_folder_of_others_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    (tmp_path / "dataset.json").write_text('{"format": "another"}')
    with pytest.raises(OutputError, match="expected a new or empty folder"):
        require_ours(tmp_path, TINY)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dataset.json", "thesis.tex"]


def test_new_empty_and_own_folders_are_claimed(tmp_path: Path, dataset: Path) -> None:
    (tmp_path / "empty").mkdir()
    for folder in (tmp_path / "new" / "deep", tmp_path / "empty"):
        with build_lock(folder, TINY):
            pass
    shutil.rmtree(dataset / ".build")
    with build_lock(dataset, TINY):
        pass
    assert verify(dataset) == []


@pytest.mark.parametrize("name", ["file", "file/out"])
def test_a_file_in_the_way_is_a_clear_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="choose another output folder"), build_lock(tmp_path / name, TINY):
        pytest.fail("built in a file")


def test_a_disk_that_is_too_small_is_found_before(tmp_path: Path) -> None:
    require_space(tmp_path / "not" / "yet", 1)
    with pytest.raises(OutputError, match=r"expected 888\.2 PiB free, got"):
        require_space(tmp_path / "not" / "yet", 10**18)


def test_atomic_files_are_whole(tmp_path: Path) -> None:
    write_atomic(tmp_path / "a" / "b", b"one")
    write_atomic(tmp_path / "a" / "b", b"two")
    assert (tmp_path / "a" / "b").read_bytes() == b"two"
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b"]


STOPPED = """
import sys
from pathlib import Path
from dataset_builder import lease
lease.RENEW, lease.LAPSE = 0.1, 1.5
lease.machine = lambda: {'host': 'laptop', 'boot': 'x', 'pids': 'y'}
from tests.shards import tiny_dataset
def publish(folder, manifest):
    print('waiting', flush=True)
    sys.stdin.readline()
    real(folder, manifest)
real, tiny_dataset.publish_dataset = tiny_dataset.publish_dataset, publish
try:
    tiny_dataset.build(Path(sys.argv[1]))
except tiny_dataset.OutputError as error:
    print(error, flush=True)
"""


def test_a_build_that_was_stopped_and_replaced_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped just before it publishes; another machine builds meanwhile; then it goes on."""
    monkeypatch.setattr(lease, "LAPSE", 1.5)
    script = STOPPED.replace("tiny_dataset.OutputError", "lease.OutputError")
    with subprocess.Popen([sys.executable, "-c", script, str(tmp_path)], cwd=Path(__file__).parents[2], text=True,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdin is not None and holder.stdout is not None and holder.stdout.readline() == "waiting\n"
        holder.send_signal(signal.SIGSTOP)
        build(tmp_path)
        before = [(path, path.lstat().st_mtime_ns, path.lstat().st_ino) for path in sorted(tmp_path.glob("*/*.*"))]
        holder.send_signal(signal.SIGCONT)
        said, _ = holder.communicate("\n")
    assert "stood still for over 1.5 s" in said and verify(tmp_path) == []
    assert before == [(path, path.lstat().st_mtime_ns, path.lstat().st_ino) for path in sorted(tmp_path.glob("*/*.*"))]
