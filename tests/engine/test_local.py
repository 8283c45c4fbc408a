"""Running units, in this process or in several: what every engine keeps to."""

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.engine import local, ray_cluster
from dataset_builder.errors import OutputError, SpecError
from dataset_builder.processes import cores
from dataset_builder.spec.load import load_dataset
from tests.engine.ray_machines import cluster_of

Run = Callable[..., Iterator[Any]]
ENGINES = (local.run, ray_cluster.run)
# Ray leaves what it opened for its processes to the collector
pytestmark = [pytest.mark.filterwarnings("ignore::ResourceWarning"),
              pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]


@pytest.fixture(scope="module", params=ENGINES, ids=lambda run: run.__module__)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Every way to run units; on Ray, one cluster for all tests."""
    if request.param is local.run:
        yield request.param
        return
    with cluster_of(1, tmp_path_factory.mktemp("machine"), cpus=2):
        yield request.param


def test_one_worker_is_this_process_and_keeps_the_order() -> None:
    started: list[int] = []
    results = local.run(lambda unit: started.append(unit) or -unit, [3, 1, 2], workers=1)
    assert next(results) == -3 and started == [3]
    assert list(results) == [-1, -2]


def test_several_do_every_unit_once(run: Run) -> None:
    assert sorted(run(abs, range(-12, 0), workers=2)) == list(range(1, 13))
    assert list(run(abs, [], workers=2)) == []


def test_what_goes_wrong_in_a_process_comes_back_whole(run: Run, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
        list(run(math.sqrt, [4.0, -1.0], workers=2))
    with pytest.raises(SpecError, match=r"none\.yaml: expected a file, found none") as caught:
        list(run(load_dataset, [tmp_path / "none.yaml"], workers=2))
    assert [problem.rule for problem in caught.value.problems] == ["expected a file, found none"]


def test_a_process_that_dies_is_told(run: Run) -> None:
    with pytest.raises(OutputError, match="a worker process died, possibly out of memory; finished examples"):
        list(run(os._exit, [9], workers=2))


def test_there_is_a_core() -> None:
    assert 1 <= cores() <= (os.cpu_count() or 1)
