"""Builds on a Ray cluster of three machines and a head on this one: equal bytes, whatever dies on the way."""

import os
import signal
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from shutil import disk_usage
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import pytest

from dataset_builder.builder import Event, build
from dataset_builder.engine import ray_running
from dataset_builder.engine.node import Shipment
from dataset_builder.engine.ray_cluster import RayCluster
from dataset_builder.engine.unit import BuildJob
from dataset_builder.errors import OutputError, UserError
from dataset_builder.spec.load import load_dataset
from tests.engine.ray_machines import SMALL, cluster_of
from tests.small_specs import contents, run_build

# Ray leaves what it opened for its processes to the collector
pytestmark = [pytest.mark.filterwarnings("ignore::ResourceWarning"),
              pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]
Said = list[str]
PATIENCE = 60.0
"""Seconds until a cluster knows that a machine is gone."""


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Three machines with a processor each, and a head without."""
    temporary = tmp_path_factory.mktemp("machines")
    with cluster_of(3, temporary) as cluster:
        cluster.temporary = temporary
        yield cluster


@pytest.fixture
def said() -> Said:
    """Lines that the cluster said."""
    return []


@pytest.fixture
def cluster(machines: Any, said: Said) -> Iterator[RayCluster]:
    """A build's own view of it."""
    with RayCluster(say=said.append) as found:
        yield found


@pytest.fixture
def far(monkeypatch: pytest.MonkeyPatch) -> None:
    """No machine finds the spec where it is: they share no disk."""
    own = ray_running.shipment_of

    def shipped(job: BuildJob, build: str) -> Shipment:
        found = own(job, build)
        return replace(found, job=replace(found.job, spec_path=Path("/nowhere/small.yaml")))

    monkeypatch.setattr(ray_running, "shipment_of", shipped)


def ray_build(cluster: RayCluster, spec: Path, folder: Path, **how: Any) -> Iterator[Event]:
    return build(load_dataset(spec), folder, backend="llvm", workers=3, run=cluster.run, **how)


def test_bytes_are_those_of_a_local_build_though_two_machines_are_lost(
        far: None, machines: Any, cluster: RayCluster, said: Said, small_spec: Path, small_dataset: Path,
        tmp_path: Path) -> None:
    assert cluster.summary("llvm", None) == "engine: Ray on this machine, 3 machines, 3 workers, llvm on all"
    victims = [node for node in machines.worker_nodes if node is not machines.head_node][:2]
    for event in ray_build(cluster, small_spec, tmp_path / "far"):
        if (event.wanted or event.outcomes) and victims:
            machines.remove_node(victims.pop(), allow_graceful=False)
    # The build may end before anybody looks
    begin, lost = monotonic(), "lost: what was at work there is done elsewhere"
    while not any(lost in line for line in said) and monotonic() - begin < PATIENCE:
        cluster.look(now=True)
        sleep(0.2)
    assert not victims and any(lost in line for line in said)
    for _ in range(2):
        machines.add_node(num_cpus=1, **SMALL)
    assert contents(tmp_path / "far") == contents(small_dataset)


def test_what_is_there_is_not_made_again(far: None, machines: Any, cluster: RayCluster, small_spec: Path,
                                         small_dataset: Path, tmp_path: Path) -> None:
    """Neither what is staged, nor what the old dataset has; what was damaged is made again."""
    run_build(small_spec, tmp_path / "out", only=[0, 1, 2])
    staged = sorted((tmp_path / "out" / ".build" / "staging").glob("00000001.*.segment"))
    staged[0].write_bytes(b"damaged")
    events = list(ray_build(cluster, small_spec, tmp_path / "out"))
    kept = {outcome.ref.index for event in events for outcome in event.outcomes if outcome.kept}
    assert kept == {0, 2} and contents(tmp_path / "out") == contents(small_dataset)
    for path in (tmp_path / "out" / "shards").glob("*-train-000000-*"):
        path.unlink()
    again = list(ray_build(cluster, small_spec, tmp_path / "out"))
    assert 0 < sum(len(event.outcomes) for event in again) < 10
    assert contents(tmp_path / "out") == contents(small_dataset)


def test_examples_may_wait_where_all_machines_write(machines: Any, cluster: RayCluster, small_spec: Path,
                                                    small_dataset: Path, tmp_path: Path) -> None:
    place = tmp_path / "place"
    for event in ray_build(cluster, small_spec, tmp_path / "out", staging_url=f"file://{place}"):
        assert not event.outcomes or list(place.iterdir())
    assert contents(tmp_path / "out") == contents(small_dataset)
    assert not list(place.iterdir()) and not (tmp_path / "out" / ".build" / "staging").exists()


def test_nothing_stays_on_machines_but_the_cache(machines: Any) -> None:
    left = machines.temporary / f"3df-lighting-{os.getuid()}"
    assert [path.name for path in sorted(left.iterdir())] in (["builds", "cache"], ["builds"])
    assert list((left / "builds").iterdir()) == []


def test_other_versions_are_refused_by_name(machines: Any, cluster: RayCluster, small_spec: Path, tmp_path: Path,
                                            monkeypatch: pytest.MonkeyPatch) -> None:
    own = ray_running.versions
    monkeypatch.setattr(ray_running, "versions", lambda *of: {**own(*of), "scipy": "0.1", "processor": "z80 x1"})
    with pytest.raises(UserError, match=rf"machine {socket.gethostname()}: expected the versions .* got processor "
                                        r".* instead of z80 x1, scipy .* instead of 0\.1 \(install the same there"):
        list(ray_build(cluster, small_spec, tmp_path / "out"))
    assert not (tmp_path / "out" / "dataset.json").exists()


def dies(counter: Path, times: int, unit: int) -> int:
    """Work whose process dies the first few times that it is tried."""
    tries = len(list(counter.glob(f"{unit}.*")))
    (counter / f"{unit}.{tries}").touch()
    if unit == 1 and tries < times:
        os.kill(os.getpid(), signal.SIGKILL)
    return -unit


def test_a_process_that_dies_is_tried_again_and_not_for_ever(machines: Any, cluster: RayCluster,
                                                             tmp_path: Path) -> None:
    assert sorted(cluster.run(partial(dies, tmp_path, 2), [1, 2, 3], workers=3)) == [-3, -2, -1]
    found: list[int] = []
    (tmp_path / "again").mkdir()
    with pytest.raises(OutputError, match=r"its process was killed.*, 3 times"):
        found += cluster.run(partial(dies, tmp_path / "again", 9), [1, 2, 3], workers=3)
    assert len(list((tmp_path / "again").glob("1.*"))) == 3


def test_no_room_is_told_and_waited_for_and_then_the_end(machines: Any, cluster: RayCluster, said: Said,
                                                         small_spec: Path, tmp_path: Path,
                                                         monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []

    def usage(path: Path) -> Any:
        looks.append(1)
        return SimpleNamespace(free=disk_usage(path).free if len(looks) == 1 else 10)

    monkeypatch.setattr(ray_running.shutil, "disk_usage", usage)
    monkeypatch.setattr("dataset_builder.builder._require_space", lambda *_: None)
    done: list[Event] = []
    with pytest.raises(OutputError, match=r" free, got"):
        for event in ray_build(cluster, small_spec, tmp_path / "out"):
            done.append(event)
    assert sum(len(event.outcomes) for event in done) in (2, 4), "one hand-out, then none"
    assert [line.partition(":")[0] for line in said if "room" in line] == ["waiting for room"]


def telling(unit: int, told: Callable[[str], None]) -> int:
    for step in range(3):
        told(f"{unit}.{step}")
    return unit


def test_what_is_told_arrives(machines: Any, cluster: RayCluster) -> None:
    told: list[str] = []
    assert sorted(cluster.run(telling, [1, 2], workers=2, told=told.append)) == [1, 2]
    assert sorted(told) == [f"{unit}.{step}" for unit in (1, 2) for step in range(3)]


@pytest.mark.parametrize(("gpus", "wanted", "backend"), [
    ((1, 2), "auto", "cuda"), ((1, 0), "auto", "llvm"), ((), "auto", "llvm"), ((1, 1), "llvm", "llvm")])
def test_one_backend_for_all(gpus: tuple[int, ...], wanted: str, backend: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cluster = RayCluster("me:secret@host:6379")
    monkeypatch.setattr(cluster, "machines", lambda: [
        ray_running.Machine(name="m", cpus=4, gpus=count, memory=8) for count in gpus])
    assert cluster.backend(wanted) == backend
    said = cluster.summary(backend, None)
    assert "secret" not in said and "at host:6379" in said
    assert ("GPUs of 1 of 2 machines are not used" in said) == (gpus == (1, 0))


def test_where_the_process_of_ray_here_dies_the_build_ends_in_a_line(cluster: RayCluster,
                                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    """What `ray.wait` raises then is an OSError."""
    def broken(*arguments: Any, **named: Any) -> None:
        raise OSError("Broken pipe")

    monkeypatch.setattr("ray.wait", broken)
    with pytest.raises(OutputError, match="the head of the Ray cluster does not answer any more"):
        list(cluster.run(abs, [-1], workers=1))
