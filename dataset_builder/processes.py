"""Cores and processor of the machine, and processes that end with their parent."""

import multiprocessing
import os
import platform
import signal
import threading
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
