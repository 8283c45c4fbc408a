"""The machine, its cores and processes, and processes that end with their parent."""

import errno
import multiprocessing
import os
import platform
import signal
import socket
import threading
from contextlib import suppress
from pathlib import Path


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processor() -> str:
    """What the processor is called, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def machine() -> dict[str, str]:
    """What tells this machine since it started, and this container, from all others: where process numbers count."""
    boot = pids = ""
    with suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        pids = os.readlink("/proc/self/ns/pid")
    return {"host": socket.gethostname(), "boot": boot, "pids": pids}


def started(pid: int) -> str:
    """When a process started, so that another one of the same number is not taken for it; empty where there is none."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return "" if fields[0] in "ZX" else fields[19]
    except OSError:
        if Path("/proc/self").exists():
            return ""
    try:
        os.kill(pid, 0)
    except OSError as error:
        return "" if error.errno == errno.ESRCH else "unknown"
    return "unknown"


def follow_the_parent(number: int = 0) -> None:
    """Leave Ctrl-C to the parent, which ends its children; end where it was killed. For the start of a process; number:
    of the process, which whoever starts it may tell."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    """A pool's processes hold both ends of their queue, so that none would notice that nobody feeds it any more; and
    those that a server forks for others look for the server, which lives as long as they do."""
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(1)
