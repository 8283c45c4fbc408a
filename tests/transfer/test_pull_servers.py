"""Pulling from real servers, also from those that do wrong: equal bytes, or a reason and a second run that goes on."""

from pathlib import Path

import pytest

from dataset_builder.errors import UserError
from dataset_builder.remote.open_place import place_of
from dataset_builder.remote.patience import Patience
from dataset_builder.shards.verify import verify
from dataset_builder.transfer.choice import ExampleChoice
from dataset_builder.transfer.pull import pull
from tests.fault_proxy import FAULTS, Fault, Plan, fault_proxy
from tests.file_servers import KEYS, needs_nginx, nginx_server, range_server, s3_server
from tests.shards.tiny_dataset import contents

QUICK = Patience(attempts=4, stall=0.3, first=0.001, longest=0.01)
CHUNK = 16384
AT_ONCE: set[Fault] = {"bomb", "elsewhere", "endless"}
"""What is never asked for again, so that even one of them is the end."""
SOME = ExampleChoice(light=("1",), layers=("i_s", "mask"))


@needs_nginx
def test_from_nginx(home: Path, tmp_path: Path) -> None:
    with nginx_server(home, tmp_path) as address:
        pull(address, tmp_path / "here", chunk_size=CHUNK)
        pull(address, tmp_path / "some", choice=SOME)
    assert contents(tmp_path / "here") == contents(home)
    assert verify(tmp_path / "some") == []


def test_from_s3(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)
    with s3_server(home, "bucket") as address:
        monkeypatch.setenv("AWS_ENDPOINT_URL", address)
        pull("s3://bucket", tmp_path / "here", chunk_size=CHUNK)
        pull("s3://bucket", tmp_path / "some", choice=SOME)
    assert contents(tmp_path / "here") == contents(home)
    assert verify(tmp_path / "some") == []


@pytest.mark.parametrize("fault", sorted({*FAULTS} - AT_ONCE))
def test_a_fault_now_and_then_costs_time_alone(fault: Fault, home: Path, tmp_path: Path) -> None:
    plan = Plan(faults=[fault], rate=0.3, seed=5, after=1)
    with range_server(home) as upstream, fault_proxy(upstream, plan) as address:
        place = place_of(address, patience=QUICK)
        # A server that has not answered with a piece before is taken for one that cannot
        place.size("dataset.json")
        pull(place, tmp_path / "here", chunk_size=CHUNK)
        pull(place, tmp_path / "some", choice=SOME)
    pull(home, tmp_path / "same", choice=SOME)
    assert contents(tmp_path / "here") == contents(home)
    assert contents(tmp_path / "some") == contents(tmp_path / "same")
    assert len([one for one in plan.served if one.fault]) >= 5


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_that_stays_is_a_reason(fault: Fault, home: Path, tmp_path: Path) -> None:
    plan = Plan(faults=[fault], in_a_row=99, only="test-000000.*tar")
    with range_server(home) as upstream:
        with fault_proxy(upstream, plan) as address, pytest.raises(UserError) as caught:
            pull(place_of(address, patience=QUICK), tmp_path / "here", chunk_size=CHUNK)
        assert "test-000000" in str(caught.value)
        assert not (tmp_path / "here/dataset.json").exists()
        right = Plan(rate=0.0)
        with fault_proxy(upstream, right) as address:
            pull(place_of(address, patience=QUICK), tmp_path / "here", chunk_size=CHUNK)
    assert contents(tmp_path / "here") == contents(home)
    assert not [one.path for one in right.served if "index" in one.path or "train-000000" in one.path]


@pytest.mark.parametrize("choice", [ExampleChoice(), ExampleChoice(split=("test",)),
                                    ExampleChoice(object=("*chair*",)), SOME])
def test_bytes_at_the_server_are_those_that_are_counted(choice: ExampleChoice, home: Path, tmp_path: Path) -> None:
    plan = Plan(rate=0.0)
    with range_server(home) as upstream, fault_proxy(upstream, plan) as address:
        pulled = pull(address, tmp_path / "here", choice=choice)
    assert sum(one.sent for one in plan.served if one.path.endswith((".tar", ".manifest"))) == pulled.moved
