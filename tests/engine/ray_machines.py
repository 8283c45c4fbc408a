"""A Ray cluster of several machines on this one, for tests and benchmarks."""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dataset_builder.engine.ray_cluster import QUIET

SMALL = {"object_store_memory": 100 * 2**20, "include_dashboard": False}
"""Of a machine of a cluster for tests."""


@contextmanager
def cluster_of(machines: int, *, cpus: int = 1) -> Iterator[Any]:
    """A cluster whose head takes no work, with so many machines besides, that this process is connected to."""
    os.environ.update(QUIET)
    paths = os.environ.get("PYTHONPATH", "")
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
            ray.init(cluster.address, log_to_driver=False, configure_logging=False, logging_level="ERROR")
            yield cluster
        finally:
            os.environ["PYTHONPATH"] = paths
            ray.shutdown()
            cluster.shutdown()
