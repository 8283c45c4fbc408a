"""A Ray cluster of several machines on this one, for tests and benchmarks."""

import json
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dataset_builder.engine.ray_cluster import QUIET

SMALL = {"object_store_memory": 100 * 2**20, "include_dashboard": False}
"""Of a machine of a cluster for tests."""


def finished(out: Path) -> int:
    """Examples that a build in `out` has staged, or put into shards that wait."""
    work = out / ".build"
    shards = [json.loads(path.read_bytes()) for path in work.glob("next/index/*.manifest")]
    return len(list(work.glob("staging/*.json"))) + sum(len(shard["examples"]) for shard in shards)


@contextmanager
def cluster_of(machines: int, temporary: Path, *, cpus: int = 1, connected: bool = True) -> Iterator[Any]:
    """A cluster whose head takes no work, with so many machines besides, that this process is connected to unless told
    otherwise. temporary: folder for what builds need on a machine."""
    before, paths = dict(os.environ), os.environ.get("PYTHONPATH", "")
    # What builds leave on a machine is theirs alone; Ray itself needs a short path
    os.environ |= {**QUIET, "TMPDIR": str(temporary), "RAY_TMPDIR": "/tmp"}
    # Processes of machines find this package where it is installed; that may be another one
    os.environ["PYTHONPATH"] = os.pathsep.join([os.getcwd(), paths]) if paths else os.getcwd()
    with warnings.catch_warnings():
        # Ray opens pipes and files of its processes and leaves them to the collector
        warnings.simplefilter("ignore", ResourceWarning)
        import ray
        from ray.cluster_utils import Cluster

        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, **SMALL})
        try:
            for _ in range(machines):
                cluster.add_node(num_cpus=cpus, **SMALL)
            if connected:
                ray.init(cluster.address, log_to_driver=False, configure_logging=False, logging_level="ERROR")
            yield cluster
        finally:
            if connected:
                ray.shutdown()
            cluster.shutdown()
            os.environ.clear()
            os.environ |= before
