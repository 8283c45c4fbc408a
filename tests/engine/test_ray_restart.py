"""A build on Ray that is interrupted, and one whose cluster loses its head: both end in a line, and are resumed."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from dataset_builder.cli.interrupt import INTERRUPTED
from tests.engine.ray_machines import cluster_of, finished
from tests.small_specs import contents

pytestmark = [pytest.mark.filterwarnings("ignore::ResourceWarning"),
              pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]
PATIENCE = 120.0


def command(spec: Path, out: Path, cluster: Any) -> subprocess.Popen[str]:
    """The build, as a user types it."""
    arguments = ["build", str(spec), "--out", str(out), "--backend", "llvm", "--engine", "ray", "--address",
                 cluster.address]
    return subprocess.Popen([sys.executable, "-m", "dataset_builder", *arguments], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, start_new_session=True)


def ended(process: subprocess.Popen[str], out: Path, more_than: int, end: Callable[[], None]) -> tuple[int, str]:
    """Exit code and errors of a build that is ended once it has finished more than so much."""
    begin = monotonic()
    while finished(out) <= more_than and process.poll() is None and monotonic() - begin < PATIENCE:
        sleep(0.05)
    end()
    _, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, errors


def test_an_interrupt_and_a_lost_head_end_in_a_line_and_are_resumed(
        small_spec: Path, small_dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with cluster_of(1, tmp_path, connected=False) as cluster:
        process = command(small_spec, out, cluster)
        code, errors = ended(process, out, 0, lambda: os.killpg(process.pid, signal.SIGINT))
        assert (code, errors.count("interrupted: what was finished is kept"), "Traceback" in errors) == (
            INTERRUPTED, 1, False)
        before = finished(out)

        def lose_the_head() -> None:
            cluster.head_node.kill_gcs_server(check_alive=False)
            cluster.head_node.kill_raylet(check_alive=False)

        code, errors = ended(command(small_spec, out, cluster), out, before, lose_the_head)
        assert code == 2 and "the head of the Ray cluster does not answer any more; finished examples" in errors
        assert not (out / "dataset.json").exists() and finished(out) > before > 0
    with cluster_of(1, tmp_path, connected=False) as cluster:
        process = command(small_spec, out, cluster)
        said, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0 and "Traceback" not in errors
        assert said.startswith(f"engine: Ray at {cluster.address}, 1 machine, 1 workers, llvm on all")
    assert contents(out) == contents(small_dataset)
