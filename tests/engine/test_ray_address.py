"""Addresses of clusters, from a process that is connected to none."""

import socket
from time import monotonic

import pytest

from dataset_builder.engine.ray_cluster import RayCluster
from dataset_builder.errors import UserError


@pytest.mark.parametrize("scheme", ["", "ray://"])
def test_an_address_that_nobody_listens_at_is_refused_at_once(scheme: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"{scheme}127.0.0.1:{server.getsockname()[1]}"
    begin = monotonic()
    with pytest.raises(UserError, match=f"--address: expected a Ray cluster at {address}, got: .*refused; start one"):
        RayCluster(address).__enter__()
    assert monotonic() - begin < 5
