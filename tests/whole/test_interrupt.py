"""Ctrl-C, wherever it strikes: one line, exit code 130, no traceback, and nothing half written."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

from dataset_builder.cli.interrupt import INTERRUPTED, guarded
from tests.small_specs import write_spec


@pytest.mark.parametrize(("seconds", "workers"), [(0.7, 1), (2.1, 1), (3.9, 1), (5.2, 1), (7.7, 1), (6.5, 2)])
def test_a_build_ends_in_one_line(tmp_path: Path, seconds: float, workers: int) -> None:
    arguments = [sys.executable, "-m", "dataset_builder", "build", str(write_spec(tmp_path)), "--out",
                 str(tmp_path / "out"), "--workers", str(workers), "--set", "splits.train.views=40", "--html",
                 str(tmp_path / "page.html")]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               start_new_session=True)
    sleep(seconds)
    os.killpg(process.pid, signal.SIGINT)
    said, errors = process.communicate(timeout=60)
    assert process.returncode == INTERRUPTED and "Traceback" not in said
    assert errors.splitlines() == [
        "interrupted: what was finished is kept, nothing is half written; run the same command again to continue"]
    assert not (tmp_path / "out" / "dataset.json").exists()
    # Early on there is no page yet
    for page in tmp_path.glob("page.html*"):
        assert page.suffix == ".html" and '<main data-state="interrupted"' in page.read_text()


def strike() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def test_an_interrupt_that_becomes_another_error_or_none_is_one_still(capsys: pytest.CaptureFixture[str]) -> None:
    def changed() -> int:
        try:
            strike()
            sleep(1)
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error
        return 0

    def swallowed() -> int:
        try:
            strike()
            sleep(1)
        except KeyboardInterrupt:
            pass
        return 0

    before = signal.getsignal(signal.SIGINT)
    for work in (changed, swallowed):
        assert guarded(work) == INTERRUPTED
        assert capsys.readouterr().err.count("interrupted") == 1
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(ImportError):
        guarded(lambda: (_ for _ in ()).throw(ImportError("initialization failed")))


def test_who_goes_on_all_the_same_is_ended(tmp_path: Path) -> None:
    script = ("from dataset_builder.cli import interrupt\nimport os, signal, time\ninterrupt.PATIENCE = 0.5\n"
              "def work():\n try:\n  os.kill(os.getpid(), signal.SIGINT); time.sleep(1)\n"
              " except KeyboardInterrupt:\n  time.sleep(60)\ninterrupt.guarded(work)")
    begin = monotonic()
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=50, check=False)
    assert ended.returncode == INTERRUPTED and ended.stderr.count("interrupted") == 1 and monotonic() - begin < 30
